"""Every check agrees on the published numbers, and ceases to when a number is wrong."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.published import checks, load_deflection, recompute, tables
from bayes_tyre.rig.axle import Rollers

COLUMNS = ["quantity", "source", "kind", "published", "recomputed", "tolerance", "agrees"]


def shifted(row: int, column: str, by: float) -> pd.DataFrame:
    means = tables.case_means()
    means[column] = means[column] + by * (means.index == row)
    return means


def test_all_agree_and_every_kind_is_there():
    table = checks.published_check(tables.case_means())
    assert list(table.columns) == COLUMNS
    assert table["kind"].value_counts().to_dict() == {"round trip": 124, "recomputed": 37, "erratum": 30}
    assert table["agrees"].dtype == bool
    assert table.loc[~table["agrees"], "quantity"].to_list() == []
    assert not table.duplicated(["quantity", "kind"]).any()


def test_agrees_means_what_it_says():
    table = pd.concat([checks.recomputed_rows(), checks.round_trip_rows(tables.case_means())])
    assert ((table["recomputed"] - table["published"]).abs() <= table["tolerance"]).all()


def test_an_erratum_lies_outside_what_is_printed():
    errata = tables.errata().set_index("item")
    values = recompute.corrected_values()
    numbers = {item for item in errata.index if checks._is_number(errata.at[item, "recomputed"])}
    assert set(values) == numbers
    for item in numbers:
        printed = str(errata.at[item, "printed"])
        if checks._is_number(printed):
            off = abs(values[item] - float(printed))
            assert off > tables.printed_digits(printed) or item.startswith("Appendix B1"), item


def test_every_number_outside_the_tables_is_recomputed():
    inputs = {"dial gauge in the reliability test", "integrated acceleration in the reliability test"}
    assert set(recompute.numbers_outside_tables()) == set(tables.printed_numbers()) - inputs


def test_a_wrong_cell_spoils_what_rests_on_it(monkeypatch):
    wrong = shifted(0, "k_kN_per_mm", 0.01)  # single (0)10-15, one of six in its means
    monkeypatch.setattr(tables, "case_means", lambda: wrong)
    rows = checks.recomputed_rows()
    assert rows.loc[~rows["agrees"], "quantity"].to_list() == [
        "mean k (kN/mm), single loading",
        "model k (kN/mm), single loading at 0 km/h",
    ]


def test_a_wrong_rig_spoils_sections_and_geometry(monkeypatch):
    right = recompute.axle.load_rig

    def wrong(name):
        rig = right(name)
        return rig.model_copy(update={"rollers": Rollers(radius_mm=134.0, half_spacing_mm=253.0)})

    monkeypatch.setattr(recompute.axle, "load_rig", wrong)
    rows = checks.recomputed_rows().set_index("quantity")
    assert not rows.at["single, h (mm)", "agrees"]
    assert not rows.at["dual, curvature factor", "agrees"]
    assert rows.at["single, second moment (1e-5 m^4)", "agrees"]


def test_the_tests_cells_of_table_10_come_back_and_a_wrong_lever_spoils_them(monkeypatch):
    rows = checks.round_trip_rows(tables.case_means())
    tests = rows[rows["quantity"].str.startswith("tests k (kN/mm), ")]
    printed = tables.model_and_tests().query("kind == 'tests'")["k_kN_per_mm"]
    assert tests["published"].to_list() == printed.to_list()
    assert set(tests["source"]) == {"Table 10"}
    assert tests["agrees"].all()
    right = load_deflection.deflection_of
    monkeypatch.setattr(load_deflection, "deflection_of", lambda rig, load, mm: right(rig, load, 1.001 * mm))
    rows = checks.round_trip_rows(tables.case_means())
    assert not rows.loc[rows["quantity"].str.startswith("tests k"), "agrees"].any()


def test_an_erratum_wrongly_corrected_does_not_agree(monkeypatch):
    errata = tables.errata()
    errata["recomputed"] = errata["recomputed"].replace("6.665", "6.664")
    monkeypatch.setattr(tables, "errata", lambda: errata)
    rows = checks.erratum_rows()
    assert rows.loc[~rows["agrees"], "quantity"].to_list() == ["single, section area (1e-3 m^2)"]


def test_a_round_trip_just_inside_and_just_outside():
    inside = checks.round_trip_rows(shifted(0, "k_kN_per_mm", 0.0005))
    assert inside["agrees"].all()
    outside = checks.round_trip_rows(shifted(1, "beta_mm", 7e-6))
    assert outside.loc[~outside["agrees"], "quantity"].to_list() == ["beta (mm), single (0)10-20"]


def test_a_missing_case_is_not_passed_over():
    rows = checks.round_trip_rows(tables.case_means().iloc[1:])
    assert len(rows) == 124
    missing = rows[rows["recomputed"].isna()]
    assert not missing["agrees"].any()
    assert missing["quantity"].to_list() == [
        "k (kN/mm), single (0)10-15",
        "beta (mm), single (0)10-15",
        "mean k (kN/mm), single loading",
        "mean beta (mm), single loading",
        "model k (kN/mm), single loading at 0 km/h",
    ]


def test_cases_may_come_in_any_order_but_once():
    shuffled = tables.case_means().sample(frac=1, random_state=1)
    pd.testing.assert_frame_equal(
        checks.round_trip_rows(shuffled), checks.round_trip_rows(tables.case_means()), check_exact=False
    )
    with pytest.raises(pd.errors.MergeError):
        checks.round_trip_rows(pd.concat([shuffled, shuffled.iloc[:1]]))


def test_calibration_lines_pass_through_the_sample():
    lines, sample = recompute.calibration_lines(), tables.raw_sample()
    for sensor, (volts, values) in recompute.SENSORS.items():
        residual = sample[values].to_numpy() - lines[sensor](sample[volts].to_numpy())
        assert np.abs(residual).max() < np.abs(lines[sensor].slope) * 1e-6
