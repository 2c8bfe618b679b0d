"""The NumPyro models: records, repeats in a case, cases by configuration, direction, speed, load and step.

Two models share the level of the cases: `records_model` takes force against displacement, `published_model` takes
case means such as Tables 9 and 11 alone.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.stats import norm
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.case_effects import (
    Hyperparameters,
    deterministic,
    linear_predictor,
    sample_coordinates,
    sample_reparameterised,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, prior_sites, published_sites, sample_hyperparameters
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, RecordEstimates
from bayes_tyre.inference.model.likelihood import Likelihood
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_effects import sample_repeats
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian, Reparameterised, reparameterise_few
from bayes_tyre.inference.record_data import RecordData

#: What the noise of a record is like.
NOISE = ("iid", "ar1")


def _record_level(
    approximation: LaplaceApproximation,
    factors: Factors,
    repeats: str,
    hyperparameters: Hyperparameters,
    priors: Priors,
) -> Float[Array, "records 4"]:
    """Return each record's (F_i, J, log k, log beta), with the density of the last two about their case."""
    estimates = approximation.records

    def reparameterise(above: Float[Array, "records 2"], scale: Float[Array, "records 2"]) -> Reparameterised:
        return reparameterise_few(
            sample_coordinates("shape_z", above.shape), estimates.centre[:, 2:], estimates.precision, above, scale
        )

    pair, _ = sample_repeats(reparameterise, factors, approximation.cases, repeats, hyperparameters, priors=priors)
    numpyro.factor("shape_volume", pair.log_volume)
    centre = estimates.centre
    deviation = jnp.einsum("rij,rj->ri", estimates.slope, pair.value - centre[:, 2:])
    coordinates = sample_coordinates("level_z", deviation.shape)
    level = centre[:, :2] + deviation + jnp.einsum("rij,rj->ri", estimates.factor, coordinates)
    return jnp.concatenate([level, pair.value], axis=1)


def _about_typical(
    name: str, estimate: Gaussian, spread: str, hyperparameters: Hyperparameters, priors: Priors
) -> tuple[Float[Array, " records"], Float[Array, ""]]:
    """Sample a noise parameter of each record, normal about a typical value, and return both.

    The typical value follows its records' estimates too: the larger their standard deviation, the less they determine
    it, and a step size made for the narrow part of that funnel diverges in the wide part. A record by itself has the
    typical value.
    """
    prior = priors[name]
    if len(estimate.value) == 1:
        alone = sample_reparameterised(name, estimate, *prior.parameters)
        return alone, alone[0]
    weight = 1.0 / (hyperparameters[spread] ** 2 + 1.0 / estimate.precision)
    total = jnp.sum(weight)
    information = Gaussian(jnp.reshape(jnp.sum(weight * estimate.value) / total, (1,)), jnp.reshape(total, (1,)))
    typical = sample_reparameterised(name, information, *prior.parameters)[0]
    return sample_reparameterised(f"{name}_records", estimate, typical, hyperparameters[spread]), typical


def _autocorrelation(
    estimates: RecordEstimates, hyperparameters: Hyperparameters, priors: Priors
) -> Float[Array, " records"]:
    """Return rho of each record's noise, partially pooled."""
    information = Gaussian(jnp.arctanh(estimates.rho), estimates.points * (1.0 - estimates.rho**2))
    value, typical = _about_typical("atanh_rho_typical", information, "sd_atanh_rho", hyperparameters, priors)
    deterministic("atanh_rho_typical", typical)
    return deterministic("rho", jnp.tanh(value))


def _noise(
    estimates: RecordEstimates, rho: Float[Array, " records"] | None, hyperparameters: Hyperparameters, priors: Priors
) -> Float[Array, " records"]:
    """Return sigma (kN) of each record, partially pooled."""
    value = estimates.log_sigma
    if rho is not None:
        # The innovations are determined whatever rho is, so sigma follows rho.
        value = value + 0.5 * (jnp.log1p(-(estimates.rho**2)) - jnp.log1p(-(rho**2)))
    information = Gaussian(value, 2.0 * estimates.points)
    value, typical = _about_typical("sigma_typical", information, "sd_log_sigma", hyperparameters, priors)
    deterministic("sigma_typical", jnp.exp(typical))
    return deterministic("sigma", jnp.exp(value))


def records_model(
    likelihood: Likelihood,
    data: RecordData,
    approximation: LaplaceApproximation,
    factors: Factors,
    *,
    repeats: str = "mixture",
    noise: str = "iid",
    priors: Priors = PRIORS,
) -> None:
    """Model the forces of all records (NumPyro model; sites in kN, mm; scales of k and beta are relative).

    Parameters
    ----------
    likelihood:
        Of the records' forces.
    data:
        The records as measured: where each starts.
    approximation:
        Their Laplace approximation, which shapes the coordinates and leaves the posterior as it is.
    factors:
        Cases and how they group.
    repeats:
        One of `REPEATS`; with fewer than `JUDGEABLE_REPEATS` repeats a case, always ``normal``.
    noise:
        One of `NOISE`; ``ar1`` samples a lag-1 autocorrelation rho for each record.
    priors:
        Of the hyperparameters.
    """
    hyperparameters = sample_hyperparameters(prior_sites(factors, repeats, noise), priors)
    theta = _record_level(approximation, factors, repeats, hyperparameters, priors)
    F_i, J, log_k, log_beta = theta.T
    numpyro.factor("F_i_prior", norm.logpdf(F_i, data.F_0, data.span))
    numpyro.factor("J_prior", norm.logpdf(J, 0.0, hyperparameters["sd_J"]))
    rho = _autocorrelation(approximation.records, hyperparameters, priors) if noise == "ar1" else None
    numpyro.factor("force", likelihood(theta, _noise(approximation.records, rho, hyperparameters, priors), rho))

    k = deterministic("k", jnp.exp(log_k))
    numpyro.deterministic("beta", jnp.exp(log_beta))
    numpyro.deterministic("J", J)
    numpyro.deterministic("F_i", F_i)
    numpyro.deterministic("C", F_i + J - k * data.d_0)


def published_model(
    values: Mapping[str, Float[np.ndarray, " cases"]], factors: Factors, priors: Priors = PRIORS
) -> None:
    """Model printed case means, one a case, such as Tables 9 and 11.

    One value a case cannot tell the scatter of repeats from the case's remainder: both are one term, and
    `k_case`, `beta_case` are the value to expect in print for a case with these factors. The ratio of two
    configurations is therefore the same in every case of a direction.

    Parameters
    ----------
    values:
        ``k`` (kN/mm) and ``beta`` (mm) by case.
    factors:
        How the cases group.
    priors:
        Of the hyperparameters.
    """
    hyperparameters = sample_hyperparameters(published_sites(factors), priors)
    printed = jnp.log(jnp.stack([jnp.asarray(values[parameter]) for parameter in PARAMETERS]))
    scatter = jnp.stack([hyperparameters[f"sd_log_{parameter}_published"] for parameter in PARAMETERS])[:, None]
    known = Gaussian(printed, jnp.broadcast_to(scatter**-2.0, printed.shape))
    mean = linear_predictor(factors, known, hyperparameters, priors=priors)
    for parameter, expected in zip(PARAMETERS, jnp.exp(mean + 0.5 * scatter**2), strict=True):
        # The mean of a log-normal number, not its median: printed averages over cases are to be met by averages.
        deterministic(f"{parameter}_case", expected)
    numpyro.sample("log_published", dist.Normal(mean, scatter), obs=printed)
