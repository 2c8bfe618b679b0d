"""The marginal density of a whole record given the hyperparameters, by importance sampling of its own parameters.

Leave-one-out with a record's own k and beta in the model is not informative, because they adapt to the record. The
predictive density of an unseen record is the integral over its parameters: by importance sampling about the Gaussian
posterior of the record's Laplace approximation and each draw's hyperparameters, with the same quasi-random points for
every draw. F_i and J are integrated out in closed form, or with Student-t noise by the same points.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax.scipy.special import gammaln, logsumexp
from jaxtyping import Array, Float
from scipy.stats import chi2, norm, qmc

from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates
from bayes_tyre.inference.model.coordinates.reparameterisation import (
    Gaussian,
    Reparameterised,
    reparameterise,
    reparameterise_by_slope,
)
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.likelihood.offsets import sd_of_offsets
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood
from bayes_tyre.inference.record_data import RecordData
from bayes_tyre.inference.sampling.datatree import draws_in_a_row, sd_repeat_of_cases

#: Points of each integral (a power of two, for Sobol's sequence), and degrees of freedom of the t they are drawn from.
POINTS, TAILS = 256, 6.0
#: The tails of a Student-t reach further than its scale says.
_STUDENT_WIDENING = 1.5


class RecordPopulation(NamedTuple):
    """What a record's parameters are drawn from, a draw of the posterior each; scales of k and beta are relative.

    Attributes
    ----------
    log_case, log_sd_repeat:
        Shape (draws, records, 2): logarithms of k (kN/mm) and beta (mm) of each record's case, with what its specimen,
        day and covariates add; and of the scatter.
    mean_J:
        Shape (draws, records): mean of J (kN) of each record's configuration and direction.
    sd_J, log_sigma, sd_log_sigma:
        Shape (draws,): kN; logarithm of the typical sigma (kN), and its spread among records.
    discordant_weight, student_nu:
        Shape (draws,), or None where repeats are not so modelled.
    atanh_rho, sd_atanh_rho:
        Shape (draws,), or None for independent noise.
    noise_nu:
        Shape (draws,): degrees of freedom of Student-t noise, or None for normal noise.
    """

    log_case: Float[Array, "*draws records 2"]
    log_sd_repeat: Float[Array, "*draws records 2"]
    mean_J: Float[Array, "*draws records"]
    sd_J: Float[Array, "*draws"]
    log_sigma: Float[Array, "*draws"]
    sd_log_sigma: Float[Array, "*draws"]
    discordant_weight: Float[Array, "*draws"] | None
    student_nu: Float[Array, "*draws"] | None
    atanh_rho: Float[Array, "*draws"] | None
    sd_atanh_rho: Float[Array, "*draws"] | None
    noise_nu: Float[Array, "*draws"] | None = None


def hyperparameters(posterior: xr.Dataset, factors: Factors) -> RecordPopulation:
    """Return the populations that records are drawn from.

    Parameters
    ----------
    posterior:
        Dims chain, draw, case, ...; for displacement as it was measured.
    factors:
        Of these records; the posterior was fitted with the same cases and levels.
    """
    records = factors.of_record
    by_case, sd_repeat = [], []
    for parameter in ("k", "beta"):
        by_case.append(np.log(draws_in_a_row(posterior[f"{parameter}_case"]))[:, records])
        if factors.levels.names:
            effects = {name: draws_in_a_row(posterior[f"log_{parameter}_{name}"]) for name in factors.levels.names}
            by_case[-1] = by_case[-1] + factors.levels.offset(effects.__getitem__)
        sd_repeat.append(sd_repeat_of_cases(posterior, parameter, factors)[:, records])
    # A posterior of version 0.1 has J about zero.
    mean_J = np.zeros(by_case[0].shape)
    if "J_group" in posterior:
        mean_J = draws_in_a_row(posterior["J_group"])[:, factors.group.of_case[records]]
    names = ("discordant_weight", "student_nu", "atanh_rho_typical", "sd_atanh_rho", "noise_nu")
    return RecordPopulation(
        jnp.asarray(np.stack(by_case, axis=2)),
        jnp.asarray(np.log(np.stack(sd_repeat, axis=2))),
        jnp.asarray(mean_J),
        jnp.asarray(draws_in_a_row(posterior["sd_J"])),
        jnp.asarray(np.log(draws_in_a_row(posterior["sigma_typical"]))),
        jnp.asarray(draws_in_a_row(posterior["sd_log_sigma"])),
        *(jnp.asarray(draws_in_a_row(posterior[name])) if name in posterior else None for name in names),
    )


class RecordDensity(NamedTuple):
    """Log density of each record's forces given each draw, and how many points the integral behind it rests on.

    Attributes
    ----------
    log_density, effective_points:
        Shape (draws, records).
    """

    log_density: Float[Array, "*draws records"]
    effective_points: Float[Array, "*draws records"]


def unknowns(noise: str) -> int:
    """Return over how many of its unknowns a record is integrated by points.

    They are log k, log beta, sigma; and rho of autoregressive noise, or F_i and J where the noise is a Student-t.
    """
    return {"ar1": 4, "student": 5}.get(noise, 3)


def standard_points(of_each: int, seed: int, points: int = POINTS) -> Float[Array, "points dimensions"]:
    """Return quasi-random points of a standard t with `TAILS` degrees of freedom (Owen's scrambled Sobol sequence)."""
    uniform = qmc.Sobol(of_each + 1, rng=np.random.default_rng(seed)).random(points)
    uniform = np.clip(uniform, 1e-12, 1.0 - 1e-12)
    mixing = np.sqrt(TAILS / chi2(TAILS).ppf(uniform[:, -1:]))
    return jnp.asarray(norm.ppf(uniform[:, :-1]) * mixing)


def student_points(random: np.random.Generator, shape: tuple[int, ...]) -> Float[Array, "..."]:
    """Return random points of the same t, as `log_standard` has it: its dimensions are the last axis but one."""
    mixing = np.sqrt(TAILS / random.chisquare(TAILS, (*shape[:-2], 1, shape[-1])))
    return jnp.asarray(random.standard_normal(shape) * mixing)


def log_standard(z: Float[Array, "*points dimensions"]) -> Float[Array, "*points"]:
    """Return the log density of a standard t with `TAILS` degrees of freedom."""
    dimensions = z.shape[-1]
    volume = gammaln(0.5 * (TAILS + dimensions)) - gammaln(0.5 * TAILS) - 0.5 * dimensions * jnp.log(TAILS * jnp.pi)
    return volume - 0.5 * (TAILS + dimensions) * jnp.log1p(jnp.sum(z**2, axis=-1) / TAILS)


@eqx.filter_jit
def record_density(
    likelihood: Likelihood | StudentLikelihood,
    data: RecordData,
    estimates: RecordEstimates,
    of: RecordPopulation,
    z: Float[Array, "points dimensions"],
    widening: float = DISCORDANT_WIDENING,
) -> RecordDensity:
    """Return the density of each record's forces given each draw of the hyperparameters alone.

    Parameters
    ----------
    likelihood, data, estimates:
        Of the records, and their Laplace approximation.
    of:
        The draws.
    z:
        As `standard_points` gives them, of `unknowns` dimensions.
    widening:
        How many times the usual standard deviation that of discordant repeats is.
    """
    log_z = log_standard(z)

    def given(population: RecordPopulation) -> RecordDensity:
        def integral(log_widening: float) -> tuple[Array, Array]:
            wide = population._replace(log_sd_repeat=population.log_sd_repeat + log_widening)
            reparameterised = _log_values(z[:, :2], estimates, wide)
            log_sigma, atanh_rho, narrow = noise_about(z[:, 2:], estimates, population)
            forces = forces_at(likelihood, data, population, reparameterised.value, log_sigma, atanh_rho, z[:, 3:])
            prior = log_prior_of_noise(log_sigma, atanh_rho, population) + _about_case(reparameterised.value, wide)
            weight = forces + prior + reparameterised.log_volume + narrow - log_z[:, None]
            total = logsumexp(weight, axis=0)
            return total - jnp.log(len(z)), jnp.exp(2.0 * total - logsumexp(2.0 * weight, axis=0))

        if population.discordant_weight is None:
            return RecordDensity(*integral(0.0))
        # Two integrals, each about its own posterior: a discordant record lies where the usual one never looks.
        (usual, points), (discordant, more) = integral(0.0), integral(float(np.log(widening)))
        weight = population.discordant_weight
        usual, discordant = jnp.log1p(-weight) + usual, jnp.log(weight) + discordant
        log_density = jnp.logaddexp(usual, discordant)
        return RecordDensity(log_density, jnp.where(usual > discordant, points, more))

    return jax.lax.map(given, of)


def forces_at(
    likelihood: Likelihood | StudentLikelihood,
    data: RecordData,
    of: RecordPopulation,
    log_values: Float[Array, "points records 2"],
    log_sigma: Float[Array, "points records"],
    atanh_rho: Float[Array, "points records"] | None,
    z: Float[Array, "points some *records"],
) -> Float[Array, "points records"]:
    """Return the log density of each record's forces at points of its parameters.

    F_i and J are integrated out in closed form; with Student-t noise they are at coordinates z, per unit of these.
    """

    def at(log_values: Array, log_sigma: Array, atanh_rho: Array | None, z: Array) -> Array:
        if isinstance(likelihood, StudentLikelihood):
            assert of.noise_nu is not None
            noise, z = (jnp.exp(log_sigma), of.noise_nu), jnp.broadcast_to(z.T, log_values.shape)
            return likelihood.at_coordinates(z, log_values, *noise, of.mean_J, of.sd_J)
        rho = None if atanh_rho is None else jnp.tanh(atanh_rho)
        of_offsets = likelihood.of_offsets(log_values, jnp.exp(log_sigma), rho)
        about = of_offsets.about(data.F_0 - likelihood.first_force, of.mean_J)
        return about.with_prior(sd_of_offsets(data, of.sd_J)).log_marginal

    return jax.vmap(at, in_axes=(0, 0, None if atanh_rho is None else 0, 0))(log_values, log_sigma, atanh_rho, z)


def _log_values(z: Float[Array, "points 2"], estimates: RecordEstimates, of: RecordPopulation) -> Reparameterised:
    """Return (log k, log beta) about each record's posterior given hyperparameters; leading axis points."""
    quadratic = estimates.of_log_values(of.mean_J, of.sd_J)
    slope = quadratic.slope_at(of.log_case)
    sd_repeat = jnp.exp(of.log_sd_repeat) * (1.0 if of.student_nu is None else _STUDENT_WIDENING)

    def at(z: Float[Array, "2"]) -> Reparameterised:
        return reparameterise_by_slope(
            jnp.broadcast_to(z, slope.shape), slope, quadratic.precision, of.log_case, sd_repeat
        )

    return jax.vmap(at)(z)


def noise_about(
    z: Float[Array, "points some *records"], estimates: RecordEstimates, of: RecordPopulation
) -> tuple[Float[Array, "points records"], Float[Array, "points records"] | None, Float[Array, "points records"]]:
    """Return log sigma and atanh rho (None: noise is not autoregressive) at points z, and the log volume of the map."""
    shape = (len(z), len(estimates.points))

    def reparameterised(z: Array, value: Array, precision: Array, above: Array, scale: Array) -> Reparameterised:
        def at(z: Array, value: Array) -> Reparameterised:
            return reparameterise(jnp.broadcast_to(z, precision.shape), Gaussian(value, precision), above, scale)

        return jax.vmap(at)(z, jnp.broadcast_to(value, shape))

    value, volume, atanh_rho = estimates.log_sigma, jnp.zeros(shape), None
    if of.atanh_rho is not None:
        assert of.sd_atanh_rho is not None
        information = estimates.points * (1.0 - estimates.rho**2)
        rho = reparameterised(z[:, 1], jnp.arctanh(estimates.rho), information, of.atanh_rho, of.sd_atanh_rho)
        atanh_rho, volume = rho.value, rho.log_volume
        # As in the model: what is new in each point is known whatever rho is, and sigma follows rho.
        value = value + 0.5 * (jnp.log1p(-(estimates.rho**2)) - jnp.log1p(-(jnp.tanh(atanh_rho) ** 2)))
    sigma = reparameterised(z[:, 0], value, 2.0 * estimates.points, of.log_sigma, of.sd_log_sigma)
    return sigma.value, atanh_rho, volume + sigma.log_volume


def _log_normal(value: Array, centre: Array | float, log_scale: Array) -> Array:
    return -0.5 * ((value - centre) * jnp.exp(-log_scale)) ** 2 - log_scale - 0.5 * jnp.log(2.0 * jnp.pi)


def log_prior_of_noise(
    log_sigma: Float[Array, "points records"], atanh_rho: Float[Array, "points records"] | None, of: RecordPopulation
) -> Float[Array, "points records"]:
    """Return the log density of the noise of each record, as `records_model` has it."""
    prior = _log_normal(log_sigma, of.log_sigma, jnp.log(of.sd_log_sigma))
    if atanh_rho is None:
        return prior
    assert of.atanh_rho is not None
    assert of.sd_atanh_rho is not None
    return prior + _log_normal(atanh_rho, of.atanh_rho, jnp.log(of.sd_atanh_rho))


def _about_case(log_values: Float[Array, "points records 2"], of: RecordPopulation) -> Float[Array, "points records"]:
    """Return the log density of (log k, log beta) about the case, of usual records or of a Student-t."""
    if of.student_nu is None:
        return _log_normal(log_values, of.log_case, of.log_sd_repeat).sum(axis=2)
    nu = of.student_nu
    squares = jnp.sum(((log_values - of.log_case) * jnp.exp(-of.log_sd_repeat)) ** 2, axis=2)
    volume = gammaln(0.5 * nu + 1.0) - gammaln(0.5 * nu) - jnp.log(nu * jnp.pi) - of.log_sd_repeat.sum(axis=1)
    return volume - (0.5 * nu + 1.0) * jnp.log1p(squares / nu)
