"""What is said of records whose estimate failed its check, shows more than the model has, or is not there."""

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid

from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.results.comparison.law_weights import Evidence, laws_table
from bayes_tyre.workflow.raw.estimate_limitations import with_estimates

FACTORS = grid(repeats=2, speeds=(0.0,))
SOUND = Diagnostics("pass", (), 1.0, 500.0, 500.0, 0, 0.9, 100, 4, np.nan, ("said before",))


def estimates(bad: int = 0) -> pd.DataFrame:
    status = ["Pareto k 1.1"] * bad + ["ok"] * (len(FACTORS) - bad)
    errors = {"k_kN_per_mm_se": 0.02, "k_kN_per_mm_se_without_force": 0.02, "x_kN_se": 0.04}
    errors |= {"x_kN_se_without_force": 0.04}
    return FACTORS.assign(
        status=status, second_mode_Hz=np.nan, load_ringing_Hz=np.nan, discrepancy_percent=0.0, **errors
    )


def test_nothing_is_said_where_all_is_well():
    assert with_estimates(SOUND, estimates(), 0) == SOUND


@pytest.mark.parametrize(("bad", "named"), [(1, "single 0 loading 1"), (3, "unloading 1"), (4, "and 1 more")])
def test_estimates_that_failed_their_check_are_named_and_half_of_them_fail_the_verdict(bad, named):
    found = with_estimates(SOUND, estimates(bad), 0)
    said = found.reasons if bad >= len(FACTORS) / 2 else found.limitations
    assert found.verdict == ("fail" if bad >= len(FACTORS) / 2 else "pass")
    assert named in said[-1]
    assert "3 times as wide" in said[-1]
    assert found.limitations[0] == "said before"
    assert [row["kind"] for row in found.checks if not row["passed"]] == ["data"] * (found.verdict == "fail")


def test_a_second_mode_that_the_sensors_show_is_said():
    table = estimates()
    table.loc[:1, "second_mode_Hz"] = 59.0, 61.0
    found = with_estimates(SOUND, table, 0)
    assert found.verdict == "pass"
    first, second = table["record"][:2]
    assert found.limitations[-1].startswith(f"{first}, {second}: the sensors show a second mode of the rig, at 60 Hz")


def test_a_load_that_rings_is_said():
    table = estimates()
    table.loc[:2, "load_ringing_Hz"] = 17.0, 18.0, 21.0
    found = with_estimates(SOUND, table, 0)
    assert found.verdict == "pass"
    assert f"{table['record'][2]}: the load rings after its step, at 18 Hz" in found.limitations[-1]


def test_a_force_that_is_left_out_is_said_with_what_it_does_to_standard_errors():
    table = estimates()
    table.loc[:2, "discrepancy_percent"] = 0.02, 0.04, 0.06
    table.loc[:2, "x_kN_se_without_force"] = 0.03, 0.02, 0.01
    (said,) = with_estimates(SOUND, table, 0).limitations[1:]
    assert said == (
        f"3 of {len(FACTORS)} records: load and law leave out a force, in the median of 0.04 % of the load's step; "
        "were it certain that there is none, standard errors would be 1 times for k, 0.5 times for x as large, in the "
        "median; --law auto fits what a tyre may have beyond Fancher's law"
    )
    averaged = with_estimates(SOUND, table.assign(weight_fancher=0.5, weight_relaxing=0.5), 0)
    assert averaged.limitations[-1] == said.partition("; --law auto")[0]


def test_the_laws_of_an_average_are_said_with_their_weights():
    table = estimates().assign(weight_fancher=0.25, weight_relaxing=0.75)
    said, before = with_estimates(SOUND, table, 0).limitations
    assert before == "said before"
    assert f"in the mean of {len(FACTORS)} records relaxing 0.75, fancher 0.25" in said
    assert "--law relaxing" in said
    plain, _ = with_estimates(SOUND, estimates().assign(weight_fancher=0.75, weight_relaxing=0.25), 0).limitations
    assert "with --law relaxing" not in plain


def test_the_weights_of_all_records_are_said_instead_where_they_are_those_of_the_estimates():
    names = ("fancher", "relaxing")
    logs = np.array([[0.0, 9.0], [0.0, 11.0], [0.0, 10.0]])
    of_dual = np.repeat("dual", 3)
    laws = laws_table(Evidence(names, logs, np.isfinite(logs), np.full(logs.shape, 0.5), of_dual), "simulated")
    table = estimates().assign(weight_fancher=0.25, weight_relaxing=0.75)
    said, _ = with_estimates(SOUND, table, 0, laws).limitations
    assert "of dual, over 3 records rubber that relaxes (relaxing) carried 1.00 of the weight: 3 prefer it" in said
    assert said.endswith("see laws.csv")
    assert "record by record" not in said


def test_files_without_an_estimate_are_counted():
    found = with_estimates(SOUND, estimates(), 2)
    assert found.verdict == "pass"
    assert found.limitations[-1].startswith("2 files have no estimate")
