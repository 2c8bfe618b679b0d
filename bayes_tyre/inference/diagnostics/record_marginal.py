"""The marginal density of a whole record given the hyperparameters, by importance sampling of its own parameters.

Leave-one-out with a record's own k and beta in the model is not informative, because they adapt to the record. The
predictive density of an unseen record is the integral over its parameters: by importance sampling about the Gaussian
posterior of the record's Laplace approximation and each draw's hyperparameters, with the same quasi-random points for
every draw.
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

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates
from bayes_tyre.inference.model.likelihood import Likelihood
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian, Reparameterised, reparameterise
from bayes_tyre.inference.record_data import RecordData

#: Points of each integral (a power of two, for Sobol's sequence), and degrees of freedom of the t they are drawn from.
POINTS, TAILS = 256, 6.0
#: The tails of a Student-t reach further than its scale says.
_STUDENT_WIDENING = 1.5


class Hyperparameters(NamedTuple):
    """What a record's parameters are drawn from, a draw of the posterior each; scales of k and beta are relative.

    Attributes
    ----------
    log_case, log_scatter:
        Shape (draws, records, 2): logarithms of k (kN/mm) and beta (mm) of each record's case, and of the scatter.
    sd_J, log_sigma, sd_log_sigma:
        Shape (draws,): kN; logarithm of the typical sigma (kN), and its spread among records.
    discordant_weight, student_nu:
        Shape (draws,), or None where repeats are not so modelled.
    atanh_rho, sd_atanh_rho:
        Shape (draws,), or None for independent noise.
    """

    log_case: Float[Array, "*draws records 2"]
    log_scatter: Float[Array, "*draws records 2"]
    sd_J: Float[Array, "*draws"]
    log_sigma: Float[Array, "*draws"]
    sd_log_sigma: Float[Array, "*draws"]
    discordant_weight: Float[Array, "*draws"] | None
    student_nu: Float[Array, "*draws"] | None
    atanh_rho: Float[Array, "*draws"] | None
    sd_atanh_rho: Float[Array, "*draws"] | None


def hyperparameters(posterior: xr.Dataset, factors: Factors, records: np.ndarray) -> Hyperparameters:
    """Return the populations that records of some cases are drawn from.

    Parameters
    ----------
    posterior:
        Dims chain, draw, case, ...; for displacement as it was measured.
    factors:
        What the posterior was fitted with.
    records:
        Shape (records,): the case of each record.
    """
    by_case, scatter = [], []
    for parameter in ("k", "beta"):
        by_case.append(np.log(_flat(posterior[f"{parameter}_case"]))[:, records])
        name = f"sd_log_{parameter}_repeat"
        if f"{name}_by_speed" in posterior:
            scatter.append(_flat(posterior[f"{name}_by_speed"])[:, factors.speed.of_case[records]])
        else:
            scatter.append(np.broadcast_to(_flat(posterior[name])[:, None], by_case[-1].shape))
    names = ("discordant_weight", "student_nu", "atanh_rho_typical", "sd_atanh_rho")
    return Hyperparameters(
        jnp.asarray(np.stack(by_case, axis=2)),
        jnp.asarray(np.log(np.stack(scatter, axis=2))),
        jnp.asarray(_flat(posterior["sd_J"])),
        jnp.asarray(np.log(_flat(posterior["sigma_typical"]))),
        jnp.asarray(_flat(posterior["sd_log_sigma"])),
        *(jnp.asarray(_flat(posterior[name])) if name in posterior else None for name in names),
    )


def _flat(draws: xr.DataArray) -> np.ndarray:
    sample = draws.transpose("chain", "draw", ...).to_numpy()
    return sample.reshape(-1, *sample.shape[2:])


class RecordDensity(NamedTuple):
    """Log density of each record's forces given each draw, and how many points the integral behind it rests on.

    Attributes
    ----------
    log_density, effective_points:
        Shape (draws, records).
    """

    log_density: Float[Array, "*draws records"]
    effective_points: Float[Array, "*draws records"]


def standard_points(dimensions: int, seed: int, points: int = POINTS) -> Float[Array, "points dimensions"]:
    """Return quasi-random points of a standard t with `TAILS` degrees of freedom (Owen's scrambled Sobol sequence)."""
    uniform = qmc.Sobol(dimensions + 1, rng=np.random.default_rng(seed)).random(points)
    uniform = np.clip(uniform, 1e-12, 1.0 - 1e-12)
    mixing = np.sqrt(TAILS / chi2(TAILS).ppf(uniform[:, -1:]))
    return jnp.asarray(norm.ppf(uniform[:, :-1]) * mixing)


def _log_standard(z: Float[Array, "*points dimensions"]) -> Float[Array, "*points"]:
    dimensions = z.shape[-1]
    volume = gammaln(0.5 * (TAILS + dimensions)) - gammaln(0.5 * TAILS) - 0.5 * dimensions * jnp.log(TAILS * jnp.pi)
    return volume - 0.5 * (TAILS + dimensions) * jnp.log1p(jnp.sum(z**2, axis=-1) / TAILS)


def _information(estimates: RecordEstimates) -> Float[Array, "records 4 4"]:
    """Return the information on (F_i, J, log k, log beta) of each record's Laplace approximation."""
    inverse = jnp.linalg.inv(estimates.factor)
    level = jnp.einsum("rji,rjk->rik", inverse, inverse)
    both = -level @ estimates.slope
    shape = estimates.precision - jnp.einsum("rji,rjk->rik", estimates.slope, both)
    return jnp.block([[level, both], [jnp.swapaxes(both, 1, 2), shape]])


@eqx.filter_jit
def record_density(
    likelihood: Likelihood,
    data: RecordData,
    estimates: RecordEstimates,
    of: Hyperparameters,
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
        As `standard_points` gives them; six dimensions for autoregressive noise, five without.
    widening:
        How many times the usual standard deviation that of discordant repeats is.
    """
    information, log_z = _information(estimates), _log_standard(z)

    def given(population: Hyperparameters) -> RecordDensity:
        def integral(log_widening: float) -> tuple[Array, Array]:
            wide = population._replace(log_scatter=population.log_scatter + log_widening)
            theta, volume = _theta(z[:, :4], data, estimates, information, wide)
            log_sigma, atanh_rho, narrow = _noise(z[:, 4:], estimates, population)
            rho = None if atanh_rho is None else jnp.tanh(atanh_rho)
            forces = jax.vmap(likelihood, in_axes=(0, 0, None if rho is None else 0))(theta, jnp.exp(log_sigma), rho)
            prior = _log_prior(theta, log_sigma, atanh_rho, data, population)
            weight = forces + prior + _about_case(theta[..., 2:], wide) + volume + narrow - log_z[:, None]
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


def _theta(
    z: Float[Array, "points 4"],
    data: RecordData,
    estimates: RecordEstimates,
    information: Float[Array, "records 4 4"],
    of: Hyperparameters,
) -> tuple[Float[Array, "points records 4"], Float[Array, " records"]]:
    """Return (F_i, J, log k, log beta) about each record's posterior given hyperparameters; the map's log volume."""
    widen = 0.0 if of.student_nu is None else jnp.log(_STUDENT_WIDENING)
    log_J = jnp.broadcast_to(jnp.log(of.sd_J), data.span.shape)
    log_scale = jnp.stack([jnp.log(data.span), log_J, *(of.log_scatter + widen).T], axis=1)
    above = jnp.stack([data.F_0, jnp.zeros_like(data.F_0), *of.log_case.T], axis=1)
    # In units of the scales above, which may be anything between nothing and far more than the data know.
    scale = jnp.exp(log_scale)
    scaled = information * scale[:, :, None] * scale[:, None, :]
    pull = scale * jnp.einsum("rij,rj->ri", information, estimates.centre - above)
    lower = jnp.linalg.cholesky(jnp.eye(4) + scaled)
    inverse = jax.scipy.linalg.solve_triangular(lower, jnp.broadcast_to(jnp.eye(4), lower.shape), lower=True)
    mean = jnp.einsum("rki,rkj,rj->ri", inverse, inverse, pull)
    deviation = mean + jnp.einsum("rji,pj->pri", inverse, z)
    volume = jnp.sum(log_scale, axis=1) - jnp.sum(jnp.log(jnp.diagonal(lower, axis1=1, axis2=2)), axis=1)
    return above + scale * deviation, volume


def _noise(
    z: Float[Array, "points some"], estimates: RecordEstimates, of: Hyperparameters
) -> tuple[Float[Array, "points records"], Float[Array, "points records"] | None, Float[Array, "points records"]]:
    """Return log sigma, and atanh rho for autoregressive noise, likewise; and the log volume of the map."""

    shape = (len(z), len(estimates.points))

    def placed(z: Array, value: Array, precision: Array, above: Array, scale: Array) -> Reparameterised:
        def at(z: Array, value: Array) -> Reparameterised:
            return reparameterise(jnp.broadcast_to(z, precision.shape), Gaussian(value, precision), above, scale)

        return jax.vmap(at)(z, jnp.broadcast_to(value, shape))

    value, volume, atanh_rho = estimates.log_sigma, jnp.zeros(shape), None
    if of.atanh_rho is not None:
        assert of.sd_atanh_rho is not None
        known = estimates.points * (1.0 - estimates.rho**2)
        rho = placed(z[:, 1], jnp.arctanh(estimates.rho), known, of.atanh_rho, of.sd_atanh_rho)
        atanh_rho, volume = rho.value, rho.log_volume
        # As in the model: what is new in each point is known whatever rho is, and sigma follows rho.
        value = value + 0.5 * (jnp.log1p(-(estimates.rho**2)) - jnp.log1p(-(jnp.tanh(atanh_rho) ** 2)))
    sigma = placed(z[:, 0], value, 2.0 * estimates.points, of.log_sigma, of.sd_log_sigma)
    return sigma.value, atanh_rho, volume + sigma.log_volume


def _log_normal(value: Array, centre: Array | float, log_scale: Array) -> Array:
    return -0.5 * ((value - centre) * jnp.exp(-log_scale)) ** 2 - log_scale - 0.5 * jnp.log(2.0 * jnp.pi)


def _log_prior(
    theta: Float[Array, "points records 4"],
    log_sigma: Float[Array, "points records"],
    atanh_rho: Float[Array, "points records"] | None,
    data: RecordData,
    of: Hyperparameters,
) -> Float[Array, "points records"]:
    """Return the log density of F_i, J and the noise of each record, as `hierarchical` has them."""
    prior = _log_normal(theta[..., 0], data.F_0, jnp.log(data.span)) + _log_normal(theta[..., 1], 0.0, jnp.log(of.sd_J))
    prior = prior + _log_normal(log_sigma, of.log_sigma, jnp.log(of.sd_log_sigma))
    if atanh_rho is None:
        return prior
    assert of.atanh_rho is not None
    assert of.sd_atanh_rho is not None
    return prior + _log_normal(atanh_rho, of.atanh_rho, jnp.log(of.sd_atanh_rho))


def _about_case(log_values: Float[Array, "points records 2"], of: Hyperparameters) -> Float[Array, "points records"]:
    """Return the log density of (log k, log beta) about the case, of usual records or of a Student-t."""
    if of.student_nu is None:
        return _log_normal(log_values, of.log_case, of.log_scatter).sum(axis=2)
    nu = of.student_nu
    squares = jnp.sum(((log_values - of.log_case) * jnp.exp(-of.log_scatter)) ** 2, axis=2)
    volume = gammaln(0.5 * nu + 1.0) - gammaln(0.5 * nu) - jnp.log(nu * jnp.pi) - of.log_scatter.sum(axis=1)
    return volume - (0.5 * nu + 1.0) * jnp.log1p(squares / nu)
