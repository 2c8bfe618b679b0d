"""The vocabulary: the label of a case, the columns of parameters."""

from bayes_tyre.record import AXLE_PARAMETERS, LAW_PARAMETERS, Case, parameter_column


def test_the_label_of_a_case_is_the_source_s():
    assert Case("single", "unloading", 0.0, 30.0, -10.0).label == "single (0)30-20"
    assert Case("dual", "loading", 7.5, 20.0, 2.5).label == "dual (7.5)20-22.5"


def test_a_label_says_what_is_known_of_a_case():
    nan = float("nan")
    assert Case("single", "unloading", 0.0, 30.0, -10.0).label == "single (0)30-20"
    assert Case("single", "unloading", 0.0, nan, nan).label == "single unloading (0)"
    assert Case("", "loading", nan, nan, nan).label == "loading"
    assert Case("", "", nan, nan, nan).label == "all records"
    assert Case("x", "", nan, 30.0, nan).label == "x load 30 kN"
    assert Case("single", "unloading", 0.0, 30.0, -10.0).group == "single unloading"
    assert Case("", "loading", nan, nan, nan).group == "loading"


def test_conditions_are_the_case_in_words():
    nan = float("nan")
    words = "single, unloading, 0 km/h, load 30 kN, step -10 kN"
    assert Case("single", "unloading", 0.0, 30.0, -10.0).conditions == words
    assert Case("", "loading", nan, 30.0, nan).conditions == "loading, load 30 kN"


def test_a_parameter_s_column_has_its_unit():
    assert [parameter_column(name) for name in (*LAW_PARAMETERS, *AXLE_PARAMETERS)] == [
        *("k_kN_per_mm", "x_kN", "settled_kN", "beta_mm", "n"),
        *("belt_frequency_Hz", "belt_damping", "sidewall_ratio"),
        *("m_kg", "c_kN_s_per_mm"),
    ]
