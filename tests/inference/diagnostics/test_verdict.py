"""The verdict: each criterion alone makes it fail, names the parameter and says what to do."""

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, quiet, scattered

from bayes_tyre.inference.diagnostics.attempts import MODEL_CHECKS, with_checks
from bayes_tyre.inference.diagnostics.convergence import statistics_of
from bayes_tyre.inference.diagnostics.sampling_checks import Check, mean_error, unchecked
from bayes_tyre.inference.diagnostics.verdict import Diagnostics, diagnose
from bayes_tyre.inference.sampling.run import RUNS, SamplerRun, runs_to_json
from bayes_tyre.workflow.result_folder import write_json

CHAINS, DRAWS = 4, 400
CONTRACT = {
    *("verdict", "reasons", "r_hat_max", "ess_bulk_min", "ess_tail_min"),
    *("divergences", "bfmi_min", "draws", "chains", "checks"),
}
CHECK = ("name", "kind", "passed", "value", "limit", "where", "remedy")


def tree(statistics: dict[str, np.ndarray] | None = None, chains: int = CHAINS, **changed: np.ndarray) -> xr.DataTree:
    factor_table = grid(("single",))
    return posterior(scattered(factor_table, seed=1, chains=chains, draws=DRAWS) | changed, factor_table, statistics)


def check(found: Diagnostics, name: str) -> dict[str, Any]:
    """Return the one check of a name."""
    (row,) = (row for row in found.checks if row["name"] == name)
    return row


def correlated(rho: float, *, passed: bool = True) -> Check:
    """Return a check of the model, as one of residuals has it."""
    finding, remedy = "sigma: residuals follow each other", "fit with --noise ar1"
    return Check("residual_autocorrelation", "model", passed, rho, 0.2, "sigma", finding, remedy)


def draws_of_k(seed: int = 2) -> np.ndarray:
    """Return well-mixed draws of k of each case, shape (chains, draws, 4)."""
    return 1.8 + 0.05 * np.random.default_rng(seed).normal(size=(CHAINS, DRAWS, 4))


def with_runs(made: xr.DataTree, runs: list[SamplerRun]) -> xr.DataTree:
    made.attrs[RUNS] = runs_to_json(runs)
    return made


def divergences_in(found: Diagnostics) -> dict[str, Any]:
    return next(check for check in found.checks if check["name"] == "divergences")


def only_reason(found: Diagnostics) -> str:
    assert found.verdict == "fail"
    assert len(found.reasons) == 1
    return found.reasons[0]


def slow_path(length: int) -> np.ndarray:
    """Return an AR(1) path of autocorrelation 0.95."""
    rng, path = np.random.default_rng(3), np.zeros(length)
    for i in range(1, length):
        path[i] = 0.95 * path[i - 1] + rng.normal()
    return path


def rare_tails() -> np.ndarray:
    """Return independent draws but that the tenth of them farthest out comes in one run, around the middle."""
    rng = np.random.default_rng(4)
    sample = np.sort(rng.normal(size=DRAWS))
    edge = DRAWS // 20
    body, out = rng.permutation(sample[edge:-edge]), np.stack([sample[:edge], sample[-edge:]], axis=1).ravel()
    return np.concatenate([body[: len(body) // 2], out, body[len(body) // 2 :]])


def test_a_well_mixed_posterior_passes():
    found = diagnose(with_checks(tree(), MODEL_CHECKS, [correlated(0.05)]))
    assert (found.verdict, found.reasons) == ("pass", ())
    assert found.r_hat_max == pytest.approx(1.0, abs=0.01)
    assert min(found.ess_bulk_min, found.ess_tail_min) > 100 * CHAINS
    assert found.bfmi_min == pytest.approx(2.0, abs=0.3)
    assert (found.divergences, found.draws, found.chains) == (0, DRAWS, CHAINS)
    assert found.residual_autocorrelation == 0.05


def test_a_chain_elsewhere_fails_by_r_hat():
    k = draws_of_k()
    k[3, :, 2] += 0.03
    found = diagnose(tree(k_case=k))
    reason = next(reason for reason in found.reasons if "R-hat" in reason)
    assert found.verdict == "fail"
    assert 1.01 < found.r_hat_max < 1.3
    assert reason.startswith("k_case[single (25)20-30]: R-hat 1.")
    assert "raise --warmup and --draws" in reason


def test_chains_that_stand_still_in_different_places_disagree_without_bound():
    stuck = np.broadcast_to(np.arange(CHAINS)[:, None], (CHAINS, DRAWS)).astype(float)
    found = diagnose(tree(sigma_typical=stuck))
    assert found.r_hat_max > 1e6
    assert any(reason.startswith("sigma_typical: R-hat") for reason in found.reasons)


def test_slow_chains_fail_by_effective_draws_though_they_agree():
    k = draws_of_k()
    k[:, :, 1] = np.tile(slow_path(DRAWS // 2), 2)  # halves and chains alike: R-hat has nothing to say
    found = diagnose(tree(k_case=k))
    assert found.r_hat_max <= 1.01
    assert found.ess_bulk_min < 100 * CHAINS
    bulk = next(reason for reason in found.reasons if "bulk ESS" in reason)
    least = f"below {100 * CHAINS}, 100 for each chain"
    assert bulk.startswith(f"k_case[single (0)30-20]: bulk ESS {found.ess_bulk_min:.0f} is {least}")
    assert "raise --warmup and --draws" in bulk


def test_tails_that_were_hardly_reached_fail_by_effective_draws_in_the_tails():
    found = diagnose(tree(sigma_typical=np.tile(rare_tails(), (CHAINS, 1))))
    reason = only_reason(found)
    assert found.ess_bulk_min >= 100 * CHAINS > found.ess_tail_min
    assert reason.startswith("sigma_typical: tail ESS")
    assert "raise --warmup and --draws" in reason


@pytest.mark.parametrize(("chains", "enough"), [(2, True), (4, False)])
def test_a_hundred_effective_draws_are_asked_of_each_chain(chains, enough):
    factor_table = grid(("single",))
    found = diagnose(posterior(scattered(factor_table, seed=5, chains=chains, draws=340 // chains), factor_table))
    assert 200 < found.ess_bulk_min < 400
    assert any("bulk ESS" in reason for reason in found.reasons) != enough


@pytest.mark.parametrize("count", [1, 17])
def test_divergences_fail_and_are_counted(count):
    diverging = np.zeros((CHAINS, DRAWS), dtype=bool)
    diverging.ravel()[:count] = True
    found = diagnose(tree({"diverging": diverging}))
    assert found.divergences == count
    assert only_reason(found).startswith(f"{count} divergent transition")
    assert "raise --target-accept to 0.99" in only_reason(found)
    assert "--draws" not in only_reason(found)
    check = divergences_in(found)
    assert (check["passed"], check["value"], check["limit"], "note" in check) == (False, count, 0, False)


def test_a_repeat_is_noted_and_after_the_shortest_steps_the_model_is_to_change():
    runs = [SamplerRun(0.65, 3, False), SamplerRun(0.99, 0, True)]
    passed = diagnose(with_runs(tree(), runs))
    assert passed.verdict == "pass"
    assert divergences_in(passed)["passed"]
    assert divergences_in(passed)["note"] == (
        "sampled twice: 3 divergent transitions at target acceptance 0.65, 0 divergent transitions at target "
        "acceptance 0.99 (kept)"
    )
    diverging = np.arange(CHAINS * DRAWS).reshape(CHAINS, DRAWS) == DRAWS
    failed = diagnose(with_runs(tree({"diverging": diverging}), [runs[0], SamplerRun(0.99, 1, True)]))
    assert "--target-accept" not in only_reason(failed)
    assert "--priors" in only_reason(failed)


def test_one_chain_of_stiff_energy_fails_by_bfmi():
    energy = quiet(CHAINS, DRAWS)["energy"]
    energy[2] = np.cumsum(energy[2])
    found = diagnose(tree({"energy": energy}))
    expected = np.mean(np.diff(energy[2]) ** 2) / np.var(energy[2])
    assert found.bfmi_min == pytest.approx(expected, rel=0.02)
    assert found.bfmi_min < 0.3
    reason = only_reason(found)
    assert reason.startswith("energy: BFMI 0.0")
    assert "raise --warmup" in reason


def test_a_failed_check_of_the_model_fails_the_verdict():
    failed, noted = correlated(0.31, passed=False), correlated(0.1)._replace(name="law", note="beta: says this too")
    found = diagnose(with_checks(tree(), MODEL_CHECKS, [failed, noted]))
    assert only_reason(found) == "sigma: residuals follow each other; fit with --noise ar1"
    assert found.residual_autocorrelation == 0.31
    assert found.limitations == ("beta: says this too",)
    assert np.isnan(diagnose(tree()).residual_autocorrelation)


def test_checks_that_could_not_be_made_pass_and_are_said():
    few = [unchecked(name, 1.0, "too few points") for name in ("law", "noise_along_path")]
    found = diagnose(with_checks(tree(), MODEL_CHECKS, [*few, unchecked("cases", 1.0, "too few repeats")]))
    assert found.verdict == "pass"
    said = ("law, noise_along_path: not checked: too few points", "cases: not checked: too few repeats")
    assert found.limitations == said
    assert check(found, "law")["not_checked"] == "too few points"
    assert np.isnan(check(found, "law")["value"])


def test_one_chain_fails_and_asks_for_more():
    found = diagnose(tree(chains=1))
    assert "--chains 4" in only_reason(found)
    assert np.isnan(found.r_hat_max)
    assert found.chains == 1


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_draws_that_are_no_numbers_fail(value):
    k = draws_of_k()
    k[1, 7, 3] = value
    found = diagnose(tree(k_case=k))
    assert found.verdict == "fail"
    assert any(reason.startswith("k_case: draws are not finite") for reason in found.reasons)


def test_a_probability_that_is_certain_is_no_fault():
    certain = np.random.default_rng(6).beta(1.0, 9.0, size=(CHAINS, DRAWS, 12))
    certain[..., 5] = 1.0
    assert diagnose(tree(outlier_probability=certain)).verdict == "pass"


def test_a_probability_is_judged_by_the_error_of_its_mean_not_by_r_hat_and_effective_draws():
    rare = np.full((CHAINS, DRAWS, 12), 1e-6)
    rare[0, :8, 3] = 0.3  # one run of draws in one chain: it hardly moves the mean
    found = diagnose(tree(outlier_probability=rare))
    statistics = statistics_of(tree(outlier_probability=rare))
    assert float(statistics.ess_tail["outlier_probability"].min()) < 100 * CHAINS
    assert found.verdict == "pass", found.reasons
    assert "outlier_probability" not in found.by_parameter
    assert not [each for each in found.limitations if "outlier_probability" in each]
    # 0.0005 if those eight draws were independent; as one run they are worth less, at worst one draw in sixteen.
    error = mean_error(tree(outlier_probability=rare)["posterior"].to_dataset()["outlier_probability"]).max()
    assert 0.0005 < float(error) < 0.0005 * np.sqrt(2 * 8)


def test_a_probability_whose_mean_is_not_known_is_a_limitation_and_asks_for_more_draws():
    """It makes no interval wrong, so it fails nothing."""
    unsure = np.full((CHAINS, DRAWS, 12), 0.01)
    unsure[:, :, 7] = np.tile(0.5 + 0.1 * slow_path(DRAWS), (CHAINS, 1))
    found = diagnose(tree(outlier_probability=unsure))
    assert found.verdict == "pass", found.reasons
    (limitation,) = [each for each in found.limitations if "outlier_probability" in each]
    assert limitation.startswith("outlier_probability[single 25 loading 2]: Monte Carlo error 0.0")
    assert limitation.endswith("of its mean is above 0.02; raise --draws to quote it")


def test_checks_are_the_criteria_and_those_that_failed_are_the_reasons():
    passed = diagnose(with_checks(tree(), MODEL_CHECKS, [correlated(0.1)]))
    assert {tuple(row) for row in passed.checks} == {CHECK}
    assert {row["name"]: row["kind"] for row in passed.checks} == {
        **dict.fromkeys(("finite_draws", "r_hat", "ess_bulk", "ess_tail"), "sampling"),
        **{"bfmi": "sampling", "divergences": "sampling", "residual_autocorrelation": "model", "records": "data"},
    }
    assert all(row["passed"] and not row["remedy"] for row in passed.checks)
    assert check(passed, "r_hat")["value"] == passed.r_hat_max
    failed = diagnose(
        tree({"diverging": np.ones((CHAINS, DRAWS), dtype=bool)}, sigma=np.full((CHAINS, DRAWS, 12), 1e-9))
    )
    rows = [row for row in failed.checks if not row["passed"]]
    assert len(rows) == len(failed.reasons)
    assert all(reason.endswith(f"; {row['remedy']}") for reason, row in zip(failed.reasons, rows, strict=True))
    assert {"divergences", "records"} <= {row["name"] for row in rows}


def test_every_fault_gives_its_own_reason():
    k = draws_of_k()
    k[0] += 1.0
    diverging = np.ones((CHAINS, DRAWS), dtype=bool)
    energy = np.cumsum(quiet(CHAINS, DRAWS)["energy"], axis=1)
    made = tree({"diverging": diverging, "energy": energy}, k_case=k)
    found = diagnose(with_checks(made, MODEL_CHECKS, [correlated(0.9, passed=False)]))
    for word in ("R-hat", "bulk ESS", "divergent", "BFMI", "follow each other"):
        assert sum(word in reason for reason in found.reasons) == 1


def test_a_reason_names_the_chain_and_where_its_divergences_gather():
    scale = np.exp(0.3 * np.random.default_rng(7).normal(size=(CHAINS, DRAWS)))
    diverging = np.zeros((CHAINS, DRAWS), dtype=bool)
    diverging[2] = scale[2] < np.sort(scale[2])[12]
    diverging[1, 0] = True
    reason = only_reason(diagnose(tree({"diverging": diverging}, sd_log_k_case=scale)))
    assert reason.startswith("13 divergent transitions (1 in chain 1, 12 in chain 2; most at small sd_log_k_case)")


def test_chains_that_disagree_and_stiff_energy_name_the_chain():
    k, energy = draws_of_k(), quiet(CHAINS, DRAWS)["energy"]
    k[1] += 0.2
    energy[2] = np.cumsum(energy[2])
    reasons = diagnose(tree({"energy": energy}, k_case=k)).reasons
    assert any("R-hat" in reason and "chain 1 most" in reason for reason in reasons)
    assert any(reason.startswith("energy: BFMI 0.") and "of chain 2" in reason for reason in reasons)


def test_figures_stand_by_parameter_and_by_chain():
    k, steps = draws_of_k(), np.full((CHAINS, DRAWS), 7)
    k[3, :, 2] += 0.03
    steps[0, :5] = 1023
    found = diagnose(tree({"n_steps": steps, "acceptance_rate": np.full((CHAINS, DRAWS), 0.9)}, k_case=k))
    assert found.by_parameter["k_case"]["r_hat_max"] == found.r_hat_max
    assert found.by_parameter["k_case"]["r_hat_max_at"] == "k_case[single (25)20-30]"
    assert found.by_parameter["sigma_typical"]["r_hat_max"] < 1.01
    assert min(each["ess_tail_min"] for each in found.by_parameter.values()) == found.ess_tail_min
    first, second = found.by_chain[:2]
    assert (first["trees_at_limit"], first["tree_depth_max"], first["chain"]) == (5, 10, 0)
    assert (second["trees_at_limit"], second["tree_depth_max"]) == (0, 3)
    assert second["acceptance_mean"] == pytest.approx(0.9)
    assert min(chain["bfmi"] for chain in found.by_chain) == found.bfmi_min
    assert [limitation.split(":")[0] for limitation in found.limitations] == ["chain 0"]


@pytest.mark.parametrize("chains", [1, CHAINS])
def test_diagnostics_can_be_written_as_json(chains, tmp_path):
    found = diagnose(tree(chains=chains))
    write_json(found._asdict(), tmp_path / "diagnostics.json")
    read = json.loads((tmp_path / "diagnostics.json").read_text(encoding="utf-8"))
    assert set(read) >= CONTRACT
    assert read["verdict"] == found.verdict
    assert read["reasons"] == list(found.reasons)
    assert read["r_hat_max"] == (None if chains == 1 else found.r_hat_max)
    assert read["residual_autocorrelation"] is None
    assert isinstance(read["divergences"], int)
    assert read["ess_bulk_min"] == found.ess_bulk_min
    assert read["by_parameter"]["k_case"]["r_hat_max"] == (
        None if chains == 1 else found.by_parameter["k_case"]["r_hat_max"]
    )
    assert [chain["chain"] for chain in read["by_chain"]] == list(range(chains))


def test_a_verdict_is_printed_as_lines():
    lines = repr(diagnose(tree())).splitlines()
    assert lines[0] == "verdict: pass"
    assert all(line.startswith("limitation: ") for line in lines[1:-1])
    assert lines[-1].startswith("also: r_hat_max, ess_bulk_min")
