"""A narrow prior that is wrong contradicts the records however little it is moved, and one that is right does not."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.data_checks import decided_by_given_priors, failed_checks
from bayes_tyre.inference.diagnostics.prior_conflict import standard_errors_off
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

#: Far narrower than what any records say: contraction is 1e-4 and less.
NARROW = 0.0005
PLAN = Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=3, points=50)


def stated(median: float, sd_log: float = NARROW) -> Priors:
    return PRIORS.changed({"k_group": {"median": median, "sd_log": sd_log}})


def drawn(seed: int, speeds: tuple[float, ...], configurations: tuple[str, ...]) -> xr.Dataset:
    """Return a posterior sure of records that are drawn by their priors, of groups of 1 kN/mm."""
    table, rng = grid(configurations, speeds=speeds), np.random.default_rng(seed)
    factors, log_k = find_factors(table), 0.0
    for name, factor in factors.effects("k").items():
        sd = PRIORS[f"sd_log_k_{name}"].scipy().rvs(random_state=rng)
        log_k = log_k + factor.matrix @ (sd * rng.normal(size=factor.matrix.shape[1]))
    for name, size in (("case", len(factors.cases)), ("repeat", len(table))):
        if name == "repeat" or factors.has_remainder("k"):
            log_k = log_k + PRIORS[f"sd_log_k_{name}"].scipy().rvs(random_state=rng) * rng.normal(size=size)
        log_k = log_k if name == "repeat" else (log_k + np.zeros(size))[factors.of_record]
    made = posterior(scattered(table, seed=1), table)["posterior"].to_dataset()
    k = np.exp(log_k + 0.01 * rng.normal(size=made["k"].shape))
    return made.assign(k=made["k"].copy(data=k))


@pytest.mark.parametrize(("speeds", "configurations"), [((0.0,), ("a",)), ((0.0, 25.0), ("a", "b"))])
def test_a_right_prior_is_as_far_off_as_chance_has_it(speeds, configurations):
    """Of 60 groups 2.7 are beyond 2 by chance; 9 or more come up with probability 2e-3, and one beyond 4 with 4e-3."""
    off = [standard_errors_off(drawn(seed, speeds, configurations), "k", stated(1.0))[0] for seed in range(60)]
    assert np.sum(np.array(off) > 2.0) < 9
    assert np.max(off) < 4.0


def of_one_case(middle: float) -> xr.Dataset:
    """Return a posterior sure of four repeats of one case, which agree to about 2 %; k_group follows them."""
    table = grid(("a",), repeats=4)[:4].reset_index(drop=True)
    made = posterior(scattered(table, seed=1), table)["posterior"].to_dataset()
    rng = np.random.default_rng(2)
    k = middle * np.exp([-0.03, -0.01, 0.01, 0.03] + 0.01 * rng.normal(size=made["k"].shape))
    group = middle * np.exp(0.02 * rng.normal(size=made["k_group"].shape))
    return made.assign(k=made["k"].copy(data=k), k_group=made["k_group"].copy(data=group))


def test_specimens_and_covariates_are_part_of_the_error():
    """Two specimens, both 20 % stiffer than the prior: of tyres of one type that says little, of one tyre much."""
    same = of_one_case(1.2)
    specimens = same.assign_coords(record_specimen=("record", ["a 1", "a 2", "a 1", "a 2"]))
    pressure = same.assign_coords(record_covariate=(("record", "covariate"), np.full((4, 1), 1.5)))
    alone, of_two, at_pressure = (
        standard_errors_off(each, "k", stated(1.0)).item() for each in (same, specimens, pressure)
    )
    assert alone > 3.5
    assert of_two < 0.8 * alone
    assert at_pressure < 0.8 * alone


@pytest.mark.slow  # compilation, once for each prior
@pytest.mark.parametrize(("standard_errors", "fails"), [(0.0, False), (10.0, True)])
def test_a_real_fit_of_few_records_fails_for_a_wrong_prior_and_passes_for_a_right_one(standard_errors, fails):
    table = check_record_table(simulate(PLAN, seed=3)[0])
    # With the default prior log k of the group is 0.946 with a standard deviation of 0.031.
    prior = stated(np.exp(0.946 + standard_errors * 0.031))
    settings = SamplerSettings(chains=2, warmup=150, draws=150, seed=1, target_accept=0.65)
    tree = fit_hierarchical(table, settings, ModelSettings(noise="iid", priors=prior))
    drawn_k = tree["posterior"].to_dataset()
    # 300 draws know a standard deviation to 4 %: the records move nothing.
    assert float(np.log(drawn_k["k_group"]).std()) > 0.8 * NARROW
    found = failed_checks(drawn_k, prior)
    assert len(found) == fails
    assert len(decided_by_given_priors(drawn_k, prior)) == (not fails)
    if fails:
        assert found[0].where == "k_group[x loading]"
        assert found[0].remedy == "check the units of the records, or widen the prior"


def test_a_prior_that_the_records_move_contradicts_them_all_the_same():
    """Records decide: the posterior is far narrower than the prior, and far from it."""
    made = of_one_case(1.0)
    assert failed_checks(made, stated(1.0, 0.1)) == []
    (found,) = failed_checks(made, stated(2.0, 0.1))
    assert found.where == "k_group[a loading]"
    assert "not where the prior that was given has it" in found.reason
    assert failed_checks(made, stated(2.0, 0.5)) == []
