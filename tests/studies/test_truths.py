"""Truths are drawn from the priors that the model is run with."""

import numpy as np
import pytest
from numpyro import distributions as dist
from scipy.stats import kstest

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.studies.design import Design, calibration_design, outlier_design, quick_design
from bayes_tyre.studies.truths import NOTHING, Planted, Truths, draw_truths, simulate_forces, study_priors

SETS = 2000


def drawn(planted: Planted = NOTHING) -> Truths:
    return draw_truths(calibration_design(), SETS, np.random.default_rng(1), study_priors(), planted)


def levels_with_every_term(factors: Factors) -> bool:
    effects = {"speed", "step", "direction_step"}
    return effects <= set(factors.effects("beta")) and all(map(factors.has_remainder, ("k", "beta")))


def test_the_design_has_every_kind_of_term_and_repeats_that_can_be_judged():
    assert levels_with_every_term(calibration_design().factors)
    for made in (calibration_design(), quick_design(), outlier_design()):
        assert made.factors.repeats.min() == 3
        assert made.u.shape[0] == len(made.factor_table)
        assert (np.sign(made.u[:, -1]) == np.sign(made.factor_table["step_kN"])).all()


@pytest.mark.parametrize(
    ("site", "law"),
    [
        ("k_group", dist.LogNormal(np.log(1.8), 0.3)),
        ("sigma_typical", dist.LogNormal(np.log(0.006), 0.4)),
        ("sd_log_k_case", dist.LogNormal(*PRIORS["sd_log_k_case"].parameters)),
        ("discordant_weight", dist.Beta(1.0, 19.0)),
    ],
)
def test_populations_have_the_law_of_their_prior(site, law):
    # Kolmogorov-Smirnov on 2000 values: false alarm 0.1 % each.
    assert kstest(np.asarray(law.cdf(drawn()[site].reshape(SETS, -1)[:, 0])), "uniform").pvalue > 1e-3


def test_what_lies_below_a_population_scatters_as_it_says():
    truths = drawn()
    by_speed = truths["sd_log_beta_repeat_by_speed"][:, calibration_design().factors.speed.of_case]
    record = calibration_design().factors.of_record
    usual = ~truths["discordant"]
    z = (np.log(truths["beta"]) - np.log(truths["beta_case"])[:, record]) / by_speed[:, record]
    # 36 000 standard normal numbers: their standard deviation is within 1.5 % of 1 but for a chance of 1e-4.
    assert np.std(z[usual]) == pytest.approx(1.0, rel=0.015)
    assert np.std(z[truths["discordant"]]) == pytest.approx(6.0, rel=0.1)
    assert np.mean(truths["discordant"]) == pytest.approx(0.05, abs=0.01)
    assert np.std(truths["J"] / truths["sd_J"][:, None]) == pytest.approx(1.0, rel=0.015)
    np.testing.assert_allclose(truths["C"], truths["F_i"] + truths["J"] - 10.0 * truths["k"])


def test_planted_errors_change_what_they_name_and_nothing_else():
    right, wrong = drawn(), drawn(Planted(scales=1.5))
    np.testing.assert_allclose(wrong["sd_log_beta_step"], 1.5 * right["sd_log_beta_step"])
    np.testing.assert_array_equal(wrong["sd_log_beta_case"], right["sd_log_beta_case"])
    np.testing.assert_array_equal(wrong["J"], right["J"])
    wider = drawn(Planted(scatter=1.5))
    record = calibration_design().factors.of_record
    deviation = [np.log(t["k"]) - np.log(t["k_case"])[:, record] for t in (right, wider)]
    np.testing.assert_allclose(deviation[1], 1.5 * deviation[0])


def test_forces_follow_the_law_with_noise_on_every_point():
    made: Design = quick_design()
    truths = draw_truths(made, 50, np.random.default_rng(2), study_priors(), Planted())
    noisy = simulate_forces(made, truths, np.random.default_rng(3))
    exact = simulate_forces(made, truths, np.random.default_rng(3), Planted(noise=0.0))
    np.testing.assert_allclose(exact[:, :, 0], truths["F_i"])
    z = (noisy - exact) / truths["sigma"][:, :, None]
    assert np.std(z) == pytest.approx(1.0, rel=0.03)
    assert (z[:, :, 0] != 0).all()
