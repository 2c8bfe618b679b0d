"""A user's records and new ones together are the model of the user's records, twice the records long."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.designed_records import prepared
from helpers.quick_design import quick_design
from scipy.linalg import toeplitz

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import UnequalNoise
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, apart_weight, prior_sites
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.laws.fancher import equation_2_offset
from bayes_tyre.record import Case
from bayes_tyre.studies.around.augmented_fit import augmented, augmented_model, log_likelihoods
from bayes_tyre.studies.design import design
from bayes_tyre.studies.truths import draw_truths, study_priors

IID = ModelSettings(noise="iid", priors=study_priors())


def records_of(repeats: int, speeds: int = 2) -> PreparedRecords:
    """Return records of 4 cases, or of more with more speeds, with forces drawn from the priors."""
    ways = (("loading", 10.0), ("unloading", -10.0))
    made = design([Case("a", way, 5.0 * v, 20.0, step) for way, step in ways for v in range(speeds)], repeats, 12)
    return prepared(made, draw_truths(made, 1, 0, study_priors())[1][0], IID)


@pytest.mark.parametrize("repeats", [1, 2, 3])
def test_twice_as_many_repeats_are_no_other_model(repeats):
    """Of 20 cases, 8 beyond what the factors fit: with two repeats some may stand apart, with three be discordant."""
    records = records_of(repeats, speeds=10)
    model = augmented_model(records, IID)
    both = augmented(records, np.asarray(records.data.F), model)
    assert both.factors.repeats.tolist() == [2 * repeats] * 20
    assert prior_sites(both.factors, model.repeats) == prior_sites(records.factors, IID.repeats)
    of_both, of_own = (
        apart_weight(each.factors, PARAMETERS, options.priors) for each, options in ((both, model), (records, IID))
    )
    assert of_both == of_own
    assert ("discordant_weight" in prior_sites(both.factors, model.repeats)) == (repeats == 3)
    assert (of_both > 0) == (repeats > 1)


def test_new_records_share_cases_prior_of_the_start_and_noise_with_those_they_repeat():
    records = prepared(quick_design(), np.zeros(quick_design().u.shape), IID)
    weight = jnp.asarray(np.random.default_rng(0).uniform(0.5, 2.0, records.data.u.shape))
    records = records._replace(whitening=UnequalNoise(weight))
    force = np.random.default_rng(1).standard_normal(records.data.u.shape)
    both, count = augmented(records, force, IID), len(force)
    np.testing.assert_array_equal(both.data.F[count:], force)
    np.testing.assert_array_equal(both.data.F[:count], records.data.F)
    for name in ("F_0", "span", "d_0", "u"):
        values = np.asarray(getattr(both.data, name))
        np.testing.assert_array_equal(values[:count], getattr(records.data, name))
        np.testing.assert_array_equal(values[count:], values[:count])
    np.testing.assert_array_equal(both.factors.of_record, np.tile(records.factors.of_record, 2))
    assert isinstance(both.whitening, UnequalNoise)
    np.testing.assert_array_equal(both.whitening.weight, np.tile(weight, (2, 1)))
    assert len(set(both.batch.records)) == 2 * count


def test_the_log_likelihood_of_a_record_is_that_of_its_noise():
    """Against a normal with the covariance written down: autoregressive, and unlike from point to point."""
    records = records_of(2)
    rng, (count, points) = np.random.default_rng(2), records.data.u.shape
    weight = rng.uniform(0.5, 2.0, (count, points))
    records = records._replace(whitening=UnequalNoise(jnp.asarray(weight)))
    values = {name: rng.uniform(0.5, 2.0, (3, count)) for name in ("F_i", "J", "k", "beta", "sigma")}
    values["rho"] = rng.uniform(-0.5, 0.8, (3, count))
    found = log_likelihoods(DirectLikelihood(records.data, records.whitening), values)
    for draw in range(3):
        for record in range(count):
            F_i, J, k, beta, sigma, rho = (float(each[draw, record]) for each in values.values())
            curve = F_i + np.asarray(equation_2_offset(records.data.u[record], k=k, J=J, beta=beta))
            sd = sigma / weight[record]
            covariance = np.outer(sd, sd) * toeplitz(rho ** np.arange(points))
            residual = np.asarray(records.data.F[record]) - curve
            square, log_volume = residual @ np.linalg.solve(covariance, residual), np.linalg.slogdet(covariance)[1]
            expected = -0.5 * (square + log_volume + points * np.log(2.0 * np.pi))
            assert found[draw, record] == pytest.approx(expected, rel=1e-9)


def test_one_record_is_refused():
    one = records_of(1).only(np.array([True, False, False, False]), IID)
    with pytest.raises(BadInput, match="holds one record"):
        augmented_model(one, replace(IID, repeats="normal"))


def test_noise_that_is_not_simulated_is_refused():
    with pytest.raises(BadInput, match="noise student, which --around does not simulate"):
        augmented_model(records_of(1), replace(IID, noise="student"))
