"""The estimate of one record: k, x, beta, m and c with their covariance, and the checks of the fit."""

import functools
from dataclasses import dataclass, field
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.inference.motion.record.checks import failed_checks, misfits, sizes_left_out
from bayes_tyre.inference.motion.record.evidence import log_evidence
from bayes_tyre.inference.motion.record.highest_peak import drawn_about_highest_peak
from bayes_tyre.inference.motion.record.importance_sampling import WeightedDraws
from bayes_tyre.inference.motion.record.map_fit import MapEstimate
from bayes_tyre.inference.motion.record.model.parameters import in_units, parameter_names
from bayes_tyre.inference.motion.record.model.window import Recorded, Window, make_window
from bayes_tyre.inference.motion.record.nuts import SETTINGS, effective_draws, sample_motion
from bayes_tyre.inference.motion.record.window_fit import fit_window
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.rig.axle import Rig
from bayes_tyre.runtime import drop_code_where_full

#: Reported parameters of Fancher's law, in order; units kN/mm, kN, mm, kg, kN s/mm.
RECORD_PARAMETERS = FANCHER.reported_parameters


@dataclass(frozen=True)
class MotionEstimate:
    """The estimate of a record.

    Attributes
    ----------
    log_mean, log_covariance:
        Of the natural logarithms of the law's `reported_parameters`, shape (p,) and (p, p), priors included.
    method:
        `importance` from weighted draws; `nuts` where the weights are unreliable and the motion fits a stationary
        record; `laplace` from the peak otherwise.
    log_draws, weights:
        Draws of the same logarithms, shape (draws, p), and their weights, shape (draws,), of sum 1.
    map_estimate:
        All parameters, misfit of each channel, steps taken.
    window:
        The data that were fitted.
    pareto_k, effective_draws:
        Tail index of the weights about the peak; effective number of draws.
    log_evidence:
        Log density of the record's readings under law and priors, all parameters integrated out (`evidence`).
    discrepancy_share:
        Standard deviation of the force that load and law leave out, while the tyre moves fastest, as a share of the
        load's step; 0 where the readings do not ask for one.
    load_departure_share:
        Standard deviation of the load's departure from the shape of its step, as a share of the step, by the load cell;
        0 where its readings do not ask for one.
    narrower_without_force:
        Standard deviations of the logarithms if it were certain that load and law leave out no force, over those with
        the force, shape (p,): 1 less its square is the share of a parameter's information that the force takes.
    status:
        Empty, or why the estimate is not to be trusted as it stands.
    law_weights:
        Of an average over laws (`law_average`): how probable each is, by name, of sum 1; empty of a single law.
    by_law:
        Of an average: the estimates by the laws that have an evidence, by name; empty of a single law.
    """

    log_mean: Float[np.ndarray, " p"]
    log_covariance: Float[np.ndarray, "p p"]
    method: str
    log_draws: Float[np.ndarray, "draws p"]
    weights: Float[np.ndarray, " draws"]
    map_estimate: MapEstimate
    window: Window
    pareto_k: float
    effective_draws: float
    log_evidence: float
    discrepancy_share: float
    load_departure_share: float
    narrower_without_force: Float[np.ndarray, " p"]
    status: str
    law_weights: dict[str, float] = field(default_factory=dict)
    by_law: "dict[str, MotionEstimate]" = field(default_factory=dict)

    @property
    def value(self) -> Float[np.ndarray, " p"]:
        """Return the estimates in physical units."""
        return np.exp(self.log_mean)

    @property
    def has_posterior(self) -> bool:
        """Whether the moments are the posterior's: from draws, wherever the solver stopped, or about a peak."""
        return self.method != "laplace" or bool(self.map_estimate.converged)


def estimate_motion(
    rig: Rig, recorded: Recorded, law: MotionLaw = FANCHER, sampler: SamplerSettings | None = SETTINGS
) -> MotionEstimate:
    """Return the estimate of one record.

    Parameters
    ----------
    rig:
        Geometry, effective mass and its standard deviation.
    recorded:
        Its three channels, rest and ramp.
    law:
        Of the tyre.
    sampler:
        NUTS settings for a record without a disturbance whose weights are unreliable, a minute or two; None: no NUTS.

    Raises
    ------
    ValueError
        For an average over laws, which `law_average.estimate_by` takes.
    """
    if law.averaged:
        raise ValueError(f"{law.name} is an average over laws; use law_average.estimate_by")
    drop_code_where_full()
    fit, weighted = drawn_about_highest_peak(rig, fit_window(rig, make_window(rig, recorded, law=law)))
    window, estimate = fit.window, fit.estimate
    draws = _posterior_draws(rig, window, estimate, weighted, sampler)
    if draws.method == "laplace":
        mean, covariance = laplace_moments(rig, estimate, window)
    else:
        mean, covariance = _moments(draws.log_draws, draws.weights)
    force, departure = sizes_left_out(window)
    narrower = np.ones(len(mean))
    if fit.without_force is not None:
        both = estimate, estimate._replace(covariance=np.asarray(fit.without_force))
        wide, narrow = (np.diag(laplace_moments(rig, each, window)[1]) for each in both)
        narrower = np.sqrt(narrow / wide)
    return MotionEstimate(
        log_mean=mean,
        log_covariance=covariance,
        method=draws.method,
        log_draws=draws.log_draws,
        weights=draws.weights,
        map_estimate=estimate,
        window=window,
        pareto_k=weighted.pareto_k,
        effective_draws=draws.effective,
        log_evidence=log_evidence(window, estimate, weighted if draws.method == "importance" else None),
        discrepancy_share=force,
        load_departure_share=departure,
        narrower_without_force=narrower,
        status="; ".join(failed_checks(rig, fit, weighted, about_peak=draws.method == "laplace")),
    )


class _PosteriorDraws(NamedTuple):
    """Draws of the logarithms of the law's `reported_parameters`, their weights, and the method of sampling."""

    log_draws: Float[np.ndarray, "draws p"]
    weights: Float[np.ndarray, " draws"]
    method: str
    effective: float


def _posterior_draws(
    rig: Rig, window: Window, estimate: MapEstimate, weighted: WeightedDraws, sampler: SamplerSettings | None
) -> _PosteriorDraws:
    """Return the weighted draws, or draws by NUTS where the weights are unreliable and the motion fits its record.

    NUTS is not used for a record with a random disturbance, which a rolling one always has: it would take most of an
    hour.
    """
    prior = jnp.asarray(window.prior)
    method = "importance" if weighted.trusted else "laplace"
    fits = bool(estimate.converged) and not misfits(rig, window, estimate) and not np.isnan(weighted.pareto_k)
    use_nuts = window.disturbance is None and fits
    if sampler is not None and method == "laplace" and use_nuts:
        standard, divergent = sample_motion(rig, window, estimate, sampler)
        logs = np.asarray(log_parameters(rig, standard, prior, window.law))
        if effective := effective_draws(logs, divergent):
            draws = logs.reshape(-1, logs.shape[-1])
            return _PosteriorDraws(draws, np.full(len(draws), 1 / len(draws)), "nuts", effective)
    draws = np.asarray(log_parameters(rig, weighted.standard, prior, window.law))
    # Far from the peak a draw may be no number; then it has no weight.
    counted = (weighted.weights > 0) | (not weighted.trusted)
    return _PosteriorDraws(draws[counted], weighted.weights[counted], method, weighted.effective)


@functools.partial(jax.jit, static_argnums=0)
def log_parameters(
    rig: Rig, standard: Float[Array, "*draws parameters"], prior: Array, law: MotionLaw = FANCHER
) -> Float[Array, "*draws p"]:
    """Return the logarithms of the law's `reported_parameters` at standardised parameters."""
    own = len(parameter_names(law))  # a rolling tyre's ground or a second mode follows

    def logs(standard: Array) -> Array:
        parameters = in_units(rig, standard[:own], prior[:, :own], law=law)
        tyre = (getattr(parameters.law, name) for name in law.reported)
        values = (*tyre, parameters.m_kg, parameters.c_kN_s_per_mm)
        return jnp.log(jnp.stack([jnp.asarray(value) for value in values]))

    return jnp.vectorize(logs, signature="(u)->(p)")(standard)


def laplace_moments(
    rig: Rig, estimate: MapEstimate, window: Window
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return mean and covariance of the logarithms of the law's `reported_parameters`, linearised in the parameters."""
    at, prior = jnp.asarray(estimate.standard), jnp.asarray(window.prior)
    jacobian = jax.jacfwd(lambda standard: log_parameters(rig, standard, prior, window.law))(at)
    return np.asarray(log_parameters(rig, at, prior, window.law)), np.asarray(
        jacobian @ estimate.covariance @ jacobian.T
    )


def _moments(
    draws: Float[np.ndarray, "draws p"], weights: Float[np.ndarray, " draws"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return weighted mean and covariance, unbiased: the divisor is 1 less the sum of the squared weights."""
    mean = weights @ draws
    deviations = draws - mean
    return mean, (weights[:, None] * deviations).T @ deviations / (1 - np.sum(weights**2))
