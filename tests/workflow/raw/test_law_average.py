"""Records weighted by all records of their configuration: moments by hand, what a part keeps, records left alone."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.inference.motion.laws import MOTION_LAWS
from bayes_tyre.inference.motion.record.likelihood import hierarchy_moments, likelihood_of
from bayes_tyre.results.comparison.law_weights import laws_table
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.workflow.raw.estimate_columns import LawRow, Posterior, columns
from bayes_tyre.workflow.raw.law_average import evidence_of, reweighted
from bayes_tyre.workflow.raw.motion_estimates import estimates_of

AUTO, CAMPAIGN, RIG = MOTION_LAWS["auto"], MOTION_LAWS["auto_campaign"], load_rig("single")
LOGS = np.log([1.8, 0.35, 0.08, 285.0, 0.0015])
PRIOR = np.array([[0.0, np.log(0.2), np.log(0.1), np.log(285.0), np.log(0.05)], np.ones(5)])


def fit(law: str, log_evidence: float, *, method: str = "importance", sd: float = 0.01, status: str = "") -> LawRow:
    """Return what is kept of a fit: k by each law is another, by 1 % each."""
    mean = LOGS + 0.01 * AUTO.averaged.index(law) * np.eye(5)[0]
    fitted = {"displacement_mm": float(AUTO.averaged.index(law)), "method": method, "pareto_k": 0.1}
    posterior = Posterior(mean, sd**2 * np.eye(5), np.full(5, 0.5), log_evidence, status, PRIOR)
    return LawRow(law, posterior, fitted | {"effective_draws": 300.0})


def part(record: str, configuration: str, fits: list[LawRow]) -> dict[str, Any]:
    """Return a row of a part, as it comes back from its file; its own moments are not of these fits."""
    log_evidence = {each.law: each.posterior.log_evidence for each in fits}
    row = dict.fromkeys(columns(AUTO), np.nan) | {"record": record, "configuration": configuration, "status": "own"}
    row |= {f"weight_{name}": 0.2 for name in AUTO.averaged} | {"origin": "simulated", "log_constant": 0.0}
    row |= {f"log_evidence_{name}": log_evidence.get(name, np.nan) for name in AUTO.averaged}
    row |= {"likelihood_rows": np.eye(5).ravel(), "effective_draws": 1.0}
    row |= {name: np.zeros(5) for name in ("likelihood_target", "log_mean", "log_variance")}
    return row | {"law_rows": [each.kept() for each in fits]}


def campaign(tmp_path: Any) -> pd.DataFrame:
    """Return three records of one configuration, one of them without a fit by the law that the others have, and one."""
    logs = dict(zip(AUTO.averaged, (0.0, 9.0, 1.0, 0.0, 0.0), strict=True))
    full = [fit(name, log) for name, log in logs.items()]
    rows = [part(f"a{i}", "dual", full) for i in range(2)]
    rows.append(part("lost", "dual", [each for each in full if each.law != "relaxing"]))
    rows.append(part("alone", "single", [fit("fancher", 0.0, status="off")]))
    pd.DataFrame(rows).to_parquet(tmp_path / "part")
    return pd.read_parquet(tmp_path / "part")


def test_what_a_part_keeps_comes_back(tmp_path):
    kept = campaign(tmp_path)["law_rows"].iloc[0][1]
    again, first = LawRow.read(kept), fit("relaxing", 9.0)
    assert again.columns == first.columns
    for mine, theirs in zip(again.posterior, first.posterior, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_the_evidence_of_a_law_whose_fit_did_not_converge_is_none(tmp_path):
    found = evidence_of(campaign(tmp_path), AUTO)
    assert found.configuration.tolist() == ["dual"] * 3 + ["single"]
    assert np.isnan(found.log_evidence[2]).tolist() == [False, True, False, False, False]
    assert found.reliable[3].tolist() == [True, False, False, False, False]
    table = pd.DataFrame([part("a", "dual", [fit("fancher", 0.0, method="laplace")])])
    assert not evidence_of(table, AUTO).reliable.any()


def test_estimates_are_the_mixture_with_the_weights_of_all(tmp_path):
    table = campaign(tmp_path)
    laws = laws_table(evidence_of(table, AUTO), "simulated")
    found, motions = estimates_of(reweighted(table, [RIG] * 4, CAMPAIGN, laws), CAMPAIGN)
    weight = laws[laws["configuration"] == "dual"].set_index("law")["weight"][list(AUTO.averaged)].to_numpy()
    assert weight[1] > 0.99
    steps = 0.01 * np.arange(5)
    mean = LOGS + weight @ steps * np.eye(5)[0]
    covariance = 0.01**2 * np.eye(5)
    covariance[0, 0] += weight @ (steps - weight @ steps) ** 2
    first = found.iloc[0]
    assert first["k_kN_per_mm"] == pytest.approx(np.exp(mean[0]))
    assert first["k_kN_per_mm_se"] == pytest.approx(np.exp(mean[0]) * np.sqrt(covariance[0, 0]))
    assert first["k_kN_per_mm_se_without_force"] == pytest.approx(0.5 * first["k_kN_per_mm_se"])
    assert (first["displacement_mm"], first["status"]) == (1.0, "ok")
    assert first["log_evidence"] == pytest.approx(np.log(weight @ np.exp([0.0, 9.0, 1.0, 0.0, 0.0])))
    expected = likelihood_of(RIG, mean, covariance, PRIOR, law=CAMPAIGN)
    np.testing.assert_allclose(motions.rows[0], expected.rows)
    np.testing.assert_allclose(motions.target[0], expected.target)
    np.testing.assert_allclose(motions.log_mean[0], hierarchy_moments(mean, covariance)[0])
    assert first["weight_relaxing"] == 0.2  # what the record by itself says


def test_a_record_has_the_weights_among_its_own_fits_or_stays_as_it_is(tmp_path):
    table = campaign(tmp_path)
    laws = laws_table(evidence_of(table, AUTO), "simulated")
    found = reweighted(table, [RIG] * 4, CAMPAIGN, laws)
    weight = laws[laws["configuration"] == "dual"].set_index("law")["weight"][list(AUTO.averaged)].to_numpy(copy=True)
    weight[1] = 0.0
    steps = 0.01 * np.arange(5)
    assert found["k_kN_per_mm"].iloc[2] == pytest.approx(1.8 * np.exp(weight @ steps / weight.sum()))
    assert found["status"].iloc[3] == "off"  # its only fit
    unknown = laws.assign(weight=np.nan)
    assert (reweighted(table, [RIG] * 4, CAMPAIGN, unknown)["status"] == "own").all()
    broken = part("a", "dual", [fit("fancher", 0.0, sd=np.nan)])
    assert reweighted(pd.DataFrame([broken]), [RIG], CAMPAIGN, laws)["status"].tolist() == ["own"]
