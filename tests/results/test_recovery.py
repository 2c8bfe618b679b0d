"""Results beside the truth: matched by words, errors and coverage by hand, and what is lost is counted."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from bayes_tyre.errors import BadInput
from bayes_tyre.record import FACTORS
from bayes_tyre.report.terminal.recovery_table import print_recovery
from bayes_tyre.results.recovery import WHAT_IT_COMPARES, of_least_squares, of_posterior


def worded(repeats: int = 3) -> pd.DataFrame:
    rows = [("single", "unloading", 0.0, 30.0, -10.0, repeat + 1) for repeat in range(repeats)]
    return pd.DataFrame(rows, columns=list(FACTORS))


TRUTH = worded().assign(record=["t1", "t2", "t3"], k_kN_per_mm=[1.0, 2.0, 4.0], beta_mm=[0.1, 0.1, 0.2])


def fits() -> pd.DataFrame:
    """Return least squares in another order, under other names, k off by +10 and -10 %, the third record lost."""
    table = worded(2).assign(record=["r1", "r2"], k_kN_per_mm=[1.1, 1.8], beta_mm=[0.05, np.nan], status=["ok", "odd"])
    return table.iloc[::-1].astype({"speed_km_h": int, "repeat": int})


def repeats() -> pd.DataFrame:
    k = worded().assign(record=["a", "b", "c"], parameter="k", median=[1.1, 2.0, 3.0], lower=0.9, upper=[1.2, 2.1, 3.1])
    beta = k.assign(parameter="beta", median=0.1, lower=0.05, upper=0.15).iloc[::-1]
    other = k.assign(parameter="sigma", median=9.0)
    return pd.concat([beta, k, other]).assign(interval=0.9, verdict="pass")


def test_least_squares_beside_the_truth():
    found = of_least_squares(TRUTH, fits())
    np.testing.assert_allclose(found.records["k_error"], [0.1, -0.1, np.nan])
    np.testing.assert_allclose(found.records["beta_error"], [-0.5, np.nan, np.nan])
    assert found.records["record"].tolist() == ["t1", "t2", "t3"]
    assert found.records["status"].tolist()[:2] == ["ok", "odd"]
    k, beta = found.summary.to_dict("records")
    assert (k["records"], beta["records"]) == (2, 1)
    assert (k["rms"], k["median"], beta["rms"]) == pytest.approx((0.1, 0.0, 0.5))
    assert np.isnan(k["covered"])
    assert (found.lost, found.unknown) == (1, 0)


def test_a_posterior_beside_the_truth_says_how_many_intervals_hold_it():
    found = of_posterior(TRUTH, repeats())
    assert found.records["k_covered"].tolist() == [1.0, 1.0, 0.0]
    assert found.records["beta_covered"].tolist() == [1.0, 1.0, 0.0]
    k, beta = found.summary.to_dict("records")
    assert k["covered"] == beta["covered"] == pytest.approx(2 / 3)
    assert k["interval"] == 0.9
    assert k["rms"] == pytest.approx(np.sqrt((0.01 + 0 + 0.0625) / 3))
    assert (found.lost, found.unknown) == (0, 0)


def test_a_motion_on_a_law_without_friction_is_held_against_what_both_have(tmp_path):
    k = repeats().query("parameter == 'k'")
    pd.concat([k, k.assign(parameter="m", median=210.0), k.assign(parameter="c")]).to_csv(tmp_path / "repeats.csv")
    TRUTH.assign(x_kN=0.4, m_kg=200.0, c_kN_s_per_mm=1.0).to_csv(tmp_path / "truth.csv", index=False)
    said = printed(tmp_path, truth=tmp_path / "truth.csv")
    assert "m: rms relative error 5.00 %, median +5.00 % (3 records)" in said
    assert "c: rms" in said
    assert "beta" not in said
    assert "no friction x and is not the truth's" in said


def test_a_motion_on_a_law_of_other_friction_says_so(tmp_path):
    k = repeats().query("parameter == 'k'")
    of_law = [repeats(), *(k.assign(parameter=name) for name in ("settled", "m", "c"))]
    pd.concat(of_law).to_csv(tmp_path / "repeats.csv")
    TRUTH.assign(x_kN=0.4, m_kg=200.0, c_kN_s_per_mm=1.0).to_csv(tmp_path / "truth.csv", index=False)
    said = printed(tmp_path, truth=tmp_path / "truth.csv")
    assert "beta: rms" in said
    assert "its beta of another curve" in said
    assert "has no friction" not in said


def test_records_without_a_truth_are_counted():
    assert of_least_squares(TRUTH.iloc[1:], fits()).unknown == 1


@pytest.mark.parametrize(
    ("truth", "table", "said"),
    [
        (TRUTH.drop(columns="beta_mm"), fits(), r"truth\.csv: has no column beta_mm"),
        (TRUTH, fits().drop(columns="repeat"), r"least_squares\.csv: has no column repeat"),
        (TRUTH.assign(repeat=1), fits(), r"truth\.csv: the factors of record 't2' stand twice"),
        (TRUTH.assign(configuration="wide"), fits(), "has the factors of no record"),
    ],
)
def test_tables_that_do_not_belong_together_are_refused(truth, table, said):
    with pytest.raises(BadInput, match=said):
        of_least_squares(truth, table)


def test_a_posterior_without_records_is_refused():
    with pytest.raises(BadInput, match="no rows of k and beta"):
        of_posterior(TRUTH, repeats().query("parameter == 'sigma'"))


def printed(*folders, truth) -> str:
    stream = io.StringIO()
    print_recovery(list(folders), truth, Console(file=stream, width=80, force_terminal=False))
    return stream.getvalue()


def test_both_kinds_of_folder_are_printed_with_their_verdict(tmp_path):
    TRUTH.to_csv(tmp_path / "truth.csv", index=False)
    for name in ("lsq", "fit"):
        (tmp_path / name).mkdir()
    fits().to_csv(tmp_path / "lsq" / "least_squares.csv", index=False)
    repeats().to_csv(tmp_path / "fit" / "repeats.csv", index=False)
    reasons = {"verdict": "fail", "reasons": ["too few draws"]}
    (tmp_path / "fit" / "diagnostics.json").write_text(json.dumps(reasons))
    text = printed(tmp_path / "lsq", tmp_path / "fit", truth=tmp_path / "truth.csv")
    lines = [line.split() for line in text.splitlines()]
    assert ["t1", "1", "1.1", "+10.0", "0.1", "0.05", "-50.0", "ok"] in lines
    assert ["t3", "4", "0.2", "lost"] in lines
    assert ["t3", "4", "3", "-25.0", "no", "0.2", "0.1", "-50.0", "no"] in lines
    assert "k: rms relative error 10.00 %, median +0.00 % (2 records)\n" in text
    assert "90 % intervals hold the truth in 67 %" in text
    assert "1 of 3 records lost" in text
    assert "verdict: fail; too few draws" in text
    assert " ".join(text.split()).endswith(WHAT_IT_COMPARES)


def test_a_folder_of_neither_kind_is_refused_and_nothing_is_printed(tmp_path):
    TRUTH.to_csv(tmp_path / "truth.csv", index=False)
    with pytest.raises(BadInput, match=r"holds neither repeats\.csv nor least_squares\.csv"):
        printed(tmp_path, truth=tmp_path / "truth.csv")
