"""What a posterior says of tests not run: of a Gaussian linear model, what its matrices say."""

from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.record import Case
from bayes_tyre.results.next_tests.candidates import Candidates, candidates, new_cases
from bayes_tyre.results.next_tests.forecast import forecast
from bayes_tyre.results.next_tests.goals import parse_goal

#: Prior standard deviations of the logarithms of k and of beta: of group means, speeds, remainders, and of repeats.
GROUP, SPEED, REST, SCATTER = np.array([[1.0, 2.0], [0.1, 0.3], [0.05, 0.2], [0.06, 0.15]])
#: Covariance of the error with which a record's points determine its k and beta: correlated, beta's above the scatter.
ERROR = np.array([[0.03**2, -0.6 * 0.03 * 0.2], [-0.6 * 0.03 * 0.2, 0.2**2]])
DRAWS = 2500


class Exact(NamedTuple):
    """The exact posterior of a linear model of cases and records, and draws of it as a fit keeps them.

    `covariance` is of log k, then log beta, of all cases: those with records, then the new one.
    """

    tree: xr.DataTree
    cases: tuple[Case, ...]
    covariance: np.ndarray


def exact() -> Exact:
    """Return it of seven of the eight cases of a grid: records of dual loading at 25 km/h are left for later."""
    whole = grid()
    missing = (whole["configuration"] == "dual") & (whole["direction"] == "loading") & (whole["speed_km_h"] == 25.0)
    records = whole[~missing].reset_index(drop=True)
    factors = find_factors(pd.concat([records, whole[missing]], ignore_index=True))
    # A parameter's values: four groups, one coordinate of speed, eight remainders, and each record's deviation.
    speed = np.array([[-1.0], [1.0]]) / np.sqrt(2.0)
    to_case = np.hstack([np.eye(4)[factors.group.of_case], speed[factors.speed.of_case], np.eye(8)])
    to_record = np.hstack([to_case[factors.of_record[: len(records)]], np.eye(len(records))])
    to_case = np.hstack([to_case, np.zeros((8, len(records)))])
    sds = [np.repeat(sd, [4, 1, 8, len(records)]) for sd in zip(GROUP, SPEED, REST, SCATTER, strict=True)]
    prior, rows = np.diag(np.concatenate(sds) ** 2), np.kron(np.eye(2), to_record)
    total = rows @ prior @ rows.T + np.kron(ERROR, np.eye(len(records)))
    after = prior - prior @ rows.T @ np.linalg.solve(total, rows @ prior)
    root = np.linalg.cholesky(after + 1e-12 * np.eye(len(after)))
    drawn = np.random.default_rng(8).normal(size=(4, DRAWS, len(after))) @ root.T
    kept = {}
    for p, (name, middle) in enumerate({"k": 0.6, "beta": -3.0}.items()):
        own = drawn[..., p * len(sds[0]) : (p + 1) * len(sds[0])]
        kept[f"{name}_group"] = np.exp(middle + own[..., :4])
        kept[f"log_{name}_speed"] = own[..., 4:5] @ speed.T
        kept[f"{name}_case"] = np.exp(middle + (own @ to_case.T)[..., :7])
        kept[name] = np.exp(middle + own @ to_record.T)
        for of, sd in {"speed": SPEED, "case": REST, "repeat": SCATTER}.items():
            kept[f"sd_log_{name}_{of}"] = np.full((4, DRAWS), sd[p])
    both = np.kron(np.eye(2), to_case)
    return Exact(posterior(kept, records), factors.cases, both @ after @ both.T)


EXACT = exact()


def held(new: tuple[Case, ...] = ()) -> Candidates:
    return candidates(EXACT.tree, new)


@pytest.mark.parametrize(
    "goal", ["k dual / single", "beta loading / unloading", "k dual (25)20-30", "beta single (0)30-20"]
)
def test_a_forecast_from_draws_is_that_of_the_linear_model_with_the_tests_rows_added(goal):
    possible = held(EXACT.cases[7:])
    parsed = parse_goal(goal, possible.cases, 7, possible.parameters)
    known = forecast(possible, parsed)
    weights = np.kron(np.eye(2)[("k", "beta").index(parsed.parameter)], parsed.weights)

    def variance_with(*tests: int) -> float:
        precision = np.linalg.inv(EXACT.covariance)
        for case in tests:
            rows = np.zeros((2, 16))
            rows[[0, 1], [case, 8 + case]] = 1.0
            precision = precision + rows.T @ np.linalg.inv(np.diag(SCATTER**2) + ERROR) @ rows
        return float(weights @ np.linalg.inv(precision) @ weights)

    # 10,000 draws know a variance within 1.4 %, standard deviation; 6 % is beyond 4 of them.
    assert known.variance_after(()) == pytest.approx(variance_with(), rel=0.06)
    for case, after in enumerate(known.variance_after_each(repeats=3)):
        assert after == pytest.approx(variance_with(case, case, case), rel=0.06)
    assert known.variance_after([7, 7, 0, 3]) == pytest.approx(variance_with(7, 7, 0, 3), rel=0.06)


def test_the_noise_of_a_record_is_the_scatter_of_repeats_and_the_error_of_its_estimate():
    for noise in held(EXACT.cases[7:]).noise:
        expected = np.diag(SCATTER**2) + ERROR
        sd = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(noise / np.outer(sd, sd), expected / np.outer(sd, sd), rtol=0.0, atol=0.05)


def with_draws(**draws: np.ndarray | float) -> xr.DataTree:
    """Return the posterior with further draws, alike in all chains."""
    tree = EXACT.tree.copy()
    made = {name: (("chain", "draw"), np.broadcast_to(value, (4, DRAWS))) for name, value in draws.items()}
    tree["posterior"] = xr.DataTree(tree["posterior"].to_dataset().assign(made))
    return tree


def test_repeats_that_may_be_discordant_or_student_tell_less():
    usual = np.linalg.inv(held().noise[0])
    weight = 0.2
    mixed = np.linalg.inv(candidates(with_draws(discordant_weight=weight), ()).noise[0])
    error = np.linalg.inv(usual) - np.diag(SCATTER**2)
    wide = np.linalg.inv(36.0 * np.diag(SCATTER**2) + error)
    np.testing.assert_allclose(mixed, (1 - weight) * usual + weight * wide, rtol=1e-6)
    # Fisher's information of the location of a bivariate Student-t is (nu + 2) / (nu + 4) of the normal's.
    student = candidates(with_draws(student_nu=4.0), ()).noise[0]
    np.testing.assert_allclose(student, np.diag(SCATTER**2) * 8.0 / 6.0 + error, rtol=1e-6)


def test_a_level_without_data_has_an_effect_that_new_cases_share():
    new = tuple(EXACT.cases[0]._replace(speed_km_h=50.0, configuration=name) for name in ("single", "dual"))
    possible = held(new)
    known = EXACT.tree["posterior"]["k_group"].sel(group=["single loading", "dual loading"])
    effects = possible.log_values[:, 7:, 0] - np.log(known.to_numpy()).reshape(-1, 2)
    # Deviations from the mean of two levels: sd^2 (1 + 1/2), shared, and a remainder of each; 10,000 draws know
    # a variance within 1.4 %, a covariance of these within 1.6 %. What a configuration has of its own at the new speed
    # is as its prior: HalfNormal(0.1) has a mean square of 0.01, times 1 + 1/4 for the four combinations met.
    covariance = np.cov(effects, rowvar=False)
    assert covariance[0, 1] == pytest.approx(1.5 * SPEED[0] ** 2, rel=0.07)
    assert covariance[0, 0] == pytest.approx(1.5 * SPEED[0] ** 2 + REST[0] ** 2 + 1.25 * 0.01, rel=0.1)


def test_a_new_case_may_stand_apart_where_the_model_has_such_cases():
    new = EXACT.cases[7:]
    posterior_set = EXACT.tree["posterior"].to_dataset()
    tree = EXACT.tree.copy()
    apart = posterior_set.assign(k_apart_probability=xr.zeros_like(posterior_set["k_case"]))
    tree["posterior"] = xr.DataTree(apart)
    group = posterior_set["k_group"].sel(group="dual loading").to_numpy().ravel()
    predictor = np.log(group) + posterior_set["log_k_speed"].sel(speed=25.0).to_numpy().ravel()
    wide, normal = (candidates(each, new).log_values[:, 7, 0] - predictor for each in (tree, EXACT.tree))
    # One of 20 is five times as wide. Of 10,000 draws with a kurtosis of 20 a variance has a standard error of 4 %.
    assert np.var(wide) == pytest.approx((1.0 + 0.05 * 24.0) * REST[0] ** 2, rel=0.2)
    assert np.var(normal) == pytest.approx(REST[0] ** 2, rel=0.07)


def test_a_new_case_has_what_its_configuration_has_of_its_own_at_its_speed():
    tree, new = EXACT.tree.copy(), EXACT.cases[7:]
    factor = find_factors(pd.DataFrame(EXACT.cases * 2)).configuration_speed
    effects = np.array([0.4 if label == "dual 25" else 0.0 for label in factor.labels])
    shape = (*[tree["posterior"].sizes[dim] for dim in ("chain", "draw")], len(effects))
    own = xr.DataArray(np.broadcast_to(effects, shape), dims=("chain", "draw", "configuration_speed"))
    own = own.assign_coords(configuration_speed=list(map(str, factor.labels)))
    tree["posterior"] = xr.DataTree(tree["posterior"].to_dataset().assign(log_k_configuration_speed=own))
    with_effect, without = (candidates(each, new).log_values[:, 7] for each in (tree, EXACT.tree))
    np.testing.assert_allclose((with_effect - without)[:, 0], 0.4, atol=1e-12)
    np.testing.assert_array_equal(with_effect[:, 1], without[:, 1])


def test_a_level_of_a_factor_that_did_not_vary_is_as_uncertain_as_its_prior():
    possible = held((EXACT.cases[0]._replace(step_kN=5.0),))
    rest = (
        possible.log_values[:, 7, 0]
        - np.log(EXACT.tree["posterior"]["k_group"].sel(group="single loading").to_numpy()).ravel()
    )
    # HalfNormal(0.2) has a mean square of 0.04, twice that for a deviation from one level; tails are heavy.
    assert np.var(rest) == pytest.approx(2 * 0.04, rel=0.4)


def test_a_common_factor_on_displacement_is_no_part_of_what_a_test_tells():
    factor = np.exp(0.2 * np.random.default_rng(1).normal(size=(4, DRAWS)))
    tree = with_draws(displacement_scale=factor)
    data = tree["posterior"].to_dataset()
    names = ("k", "k_case", "k_group", "beta", "beta_case", "beta_group")
    scaled = {name: data[name] * data["displacement_scale"] ** (1 if "beta" in name else -1) for name in names}
    scaled = {name: values.transpose(*data[name].dims) for name, values in scaled.items()}
    tree["posterior"] = xr.DataTree(data.assign(scaled))
    np.testing.assert_allclose(candidates(tree, ()).log_values, held().log_values, rtol=1e-9)


def test_new_cases_combine_what_the_data_have_within_the_loads_met():
    cases = [Case("a", "loading", 0.0, 10.0, 10.0), Case("b", "unloading", 20.0, 20.0, -5.0)]
    cases.append(Case("a", "loading", 0.0, 10.0, 5.0))
    found = new_cases(cases, {})
    assert set(found) == {
        *(Case("a", "loading", speed, 10.0, step) for speed in (0.0, 20.0) for step in (5.0, 10.0)),
        Case("b", "unloading", 0.0, 20.0, -5.0),
    } - set(cases)
    rig = {"speed_km_h": [5.0], "initial_load_kN": [10.0, 30.0], "step_kN": [10.0, -10.0]}
    assert set(new_cases(cases, rig)) == {Case("a", "loading", 5, 10, 10), Case("b", "unloading", 5, 30, -10)}
    with pytest.raises(BadInput, match="too many"):
        new_cases(cases, {"speed_km_h": [float(v) for v in range(3000)]})


def test_factors_that_the_data_do_not_have_stay_unknown():
    cases = [Case("a", None, None, None, None), Case("b", None, None, None, None)]  # pyright: ignore[reportArgumentType]
    assert new_cases(cases, {}) == []


def test_a_posterior_without_repeats_is_refused():
    table = grid()
    with pytest.raises(BadInput, match="no repeats"):
        candidates(posterior(scattered(table, 1), table), ())
    printed = table.drop(columns=["record", "repeat"]).drop_duplicates()
    only = {"k_case": fixed(np.ones(8)), "beta_case": fixed(np.ones(8)), "sd_log_k_repeat": fixed(0.1)}
    with pytest.raises(BadInput, match="fit a record table"):
        candidates(posterior(only, printed), ())


@pytest.mark.parametrize("level", ["specimen", "day"])
def test_a_fit_of_several_specimens_or_days_is_not_forecast_from(level):
    tree = exact().tree
    of_records = tree["posterior"].to_dataset()
    grouped = of_records.assign_coords({f"record_{level}": ("record", ["1"] * of_records.sizes["record"])})
    tree["posterior"] = xr.DataTree(grouped)
    with pytest.raises(BadInput, match=f"was fitted with --{level}: .* fit without --{level}"):
        candidates(tree, [])
