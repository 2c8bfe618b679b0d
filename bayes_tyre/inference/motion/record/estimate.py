"""What a fitted motion says of its record: k, x, beta, m and c with their covariance, and whether to trust it."""

import functools
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.inference.motion.record.evidence import log_evidence
from bayes_tyre.inference.motion.record.importance_sampling import Weighed, weighed_draws
from bayes_tyre.inference.motion.record.map_fit import ROUGH, Found, approach, find, settle, starts_of
from bayes_tyre.inference.motion.record.nuts import SETTINGS, effective_draws, sampled
from bayes_tyre.inference.motion.record.parameters import in_units
from bayes_tyre.inference.motion.record.road_roughness import road_of, wave_count, with_noise, with_quick_road
from bayes_tyre.inference.motion.record.window import Recorded, Window, window_of
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.rig.axle import Rig

#: The order of what is estimated with Fancher's law; units kN/mm, kN, mm, kg, kN s/mm. Others: `told_parameters`.
RECORD_PARAMETERS = FANCHER.told_parameters
#: Above this, importance weights have no reliable mean (Vehtari 2024). With fewer effective draws than this a mean is
#: off by more than a seventh of its standard deviation, for the normal that was drawn from is not like the posterior.
PARETO_K_MOST, EFFECTIVE_LEAST = 0.7, 50.0
#: Residuals' mean square beyond 1 by more, or a lag-1 autocorrelation above, says that the model misses something. Of
#: 1100 white residuals a channel the standard deviations are 0.04 and 0.03.
MISFIT_MOST, CORRELATION_MOST = 0.3, 0.2
#: Of the last fit to a rolling record, in prior standard deviations: friction turning with the road leaves kinks.
ROLLING_TOLERANCE = 1e-4


@dataclass(frozen=True)
class MotionEstimate:
    """The estimate of a record.

    Attributes
    ----------
    log_mean, log_covariance:
        Of the natural logarithms of the law's `told_parameters`, shape (p,) and (p, p), priors included.
    method:
        How they came about: `importance` from weighed draws; `nuts` where their weights are of no use and the motion
        fits a standing record; `laplace` from the peak otherwise.
    log_draws, weights:
        Draws of the same logarithms, shape (draws, p), and what each weighs, shape (draws,), their sum 1.
    found:
        All unknowns, misfit of each channel, steps taken.
    window:
        What was fitted.
    pareto_k, effective_draws:
        How heavy the tail of the weights about the peak is; how many independent draws would say as much as these.
    log_evidence:
        Log density of the record's readings under law and priors, all unknowns integrated out (`motion_evidence`).
    status:
        Empty, or why the estimate is not to be trusted as it stands.
    """

    log_mean: Float[np.ndarray, " p"]
    log_covariance: Float[np.ndarray, "p p"]
    method: str
    log_draws: Float[np.ndarray, "draws p"]
    weights: Float[np.ndarray, " draws"]
    found: Found
    window: Window
    pareto_k: float
    effective_draws: float
    log_evidence: float
    status: str

    @property
    def value(self) -> Float[np.ndarray, " p"]:
        """Return the estimates in units."""
        return np.exp(self.log_mean)


def estimate_motion(
    rig: Rig, recorded: Recorded, law: MotionLaw = FANCHER, sampler: SamplerSettings | None = SETTINGS
) -> MotionEstimate:
    """Return the estimate of one record.

    Parameters
    ----------
    rig:
        Geometry, effective mass and how well it is known.
    recorded:
        Its three channels, rest and ramp.
    law:
        Of the tyre.
    sampler:
        How much NUTS samples of a standing record whose weighed draws are of no use, a minute or two; None: nothing.
    """
    window, found = fit_window(rig, window_of(rig, recorded, law=law))
    weighed = weighed_draws(rig, found.standard, found.covariance, window)
    told = _told(rig, window, found, weighed, sampler)
    if told.method == "laplace":
        mean, covariance = laplace_moments(rig, found, window)
    else:
        mean, covariance = _moments(told.log_draws, told.weights)
    return MotionEstimate(
        log_mean=mean,
        log_covariance=covariance,
        method=told.method,
        log_draws=told.log_draws,
        weights=told.weights,
        found=found,
        window=window,
        pareto_k=weighed.pareto_k,
        effective_draws=told.effective,
        log_evidence=log_evidence(window, found, weighed if told.method == "importance" else None),
        status="; ".join([*_reasons(found), *[_untrusted(weighed)] * (told.method == "laplace")]),
    )


class _Told(NamedTuple):
    """Draws of the logarithms of the law's `told_parameters`, what each weighs, and how they came about."""

    log_draws: Float[np.ndarray, "draws p"]
    weights: Float[np.ndarray, " draws"]
    method: str
    effective: float


def _told(rig: Rig, window: Window, found: Found, weighed: Weighed, sampler: SamplerSettings | None) -> _Told:
    """Return the draws about the peak; NUTS's where these are of no use and the motion fits its standing record.

    A rolling record has many times the unknowns: NUTS on it would take the better part of an hour.
    """
    prior = jnp.asarray(window.prior)
    method = "importance" if weights_trusted(weighed) else "laplace"
    worth_it = window.rolling is None and not _reasons(found) and np.isfinite(weighed.pareto_k)
    if sampler is not None and method == "laplace" and worth_it:
        standard, divergent = sampled(rig, window, found, sampler)
        logs = np.asarray(log_parameters(rig, standard, prior, window.law))
        if effective := effective_draws(logs, divergent):
            draws = logs.reshape(-1, logs.shape[-1])
            return _Told(draws, np.full(len(draws), 1 / len(draws)), "nuts", effective)
    draws = np.asarray(log_parameters(rig, weighed.standard, prior, window.law))
    return _Told(draws, weighed.weights, method, weighed.effective)


def fit_window(rig: Rig, window: Window) -> tuple[Window, Found]:
    """Return a window, with its road where the tyre rolls, and what is found in it."""
    starts = starts_of(rig, window)
    if window.rolling is None:
        return window, jax.tree.map(np.asarray, find(rig, window, starts))
    standard, waves = approach(rig, window, starts), wave_count(window)
    road, roughness = road_of(rig, window, standard, waves)
    window = window._replace(road=road)
    rough = settle(rig, window, standard, ROUGH)
    # The first road's weights are of answers in narrower noise; its estimate in mm is the same.
    window = with_quick_road(rig, with_noise(window, rough), rough.standard, roughness)
    window = window._replace(road=road_of(rig, window, rough.standard, waves)[0])
    return window, jax.tree.map(np.asarray, settle(rig, window, rough.standard, ROLLING_TOLERANCE))


def weights_trusted(weighed: Weighed) -> bool:
    """Return whether weights have a reliable mean, and enough of the draws a share in it."""
    return weighed.pareto_k <= PARETO_K_MOST and weighed.effective >= EFFECTIVE_LEAST


@functools.partial(jax.jit, static_argnums=0)
def log_parameters(
    rig: Rig, standard: Float[Array, "*draws unknowns"], prior: Array, law: MotionLaw = FANCHER
) -> Float[Array, "*draws p"]:
    """Return the logarithms of the law's `told_parameters` at standard unknowns."""

    def logs(standard: Array) -> Array:
        unknowns = in_units(rig, standard, prior, law=law)
        of_tyre = (getattr(unknowns.law, name) for name in law.told)
        values = (*of_tyre, unknowns.m_kg, unknowns.c_kN_s_per_mm)
        return jnp.log(jnp.stack([jnp.asarray(value) for value in values]))

    return jnp.vectorize(logs, signature="(u)->(p)")(standard)


def laplace_moments(rig: Rig, found: Found, window: Window) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return mean and covariance of the logarithms of the law's `told_parameters`, to first order in the unknowns."""
    at, prior = jnp.asarray(found.standard), jnp.asarray(window.prior)
    jacobian = jax.jacfwd(lambda standard: log_parameters(rig, standard, prior, window.law))(at)
    return np.asarray(log_parameters(rig, at, prior, window.law)), np.asarray(jacobian @ found.covariance @ jacobian.T)


def _moments(
    draws: Float[np.ndarray, "draws p"], weights: Float[np.ndarray, " draws"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return weighted mean and covariance; the divisor is that of weighted draws (1 less the weights' squares)."""
    mean = weights @ draws
    off = draws - mean
    return mean, (weights[:, None] * off).T @ off / (1 - np.sum(weights**2))


def _reasons(found: Found) -> list[str]:
    """Return what there is to be said against a fit."""
    reasons = [] if found.converged else ["the fit did not converge"]
    for name, square, alike in zip(
        ("acceleration", "laser", "load"), found.chi_squared, found.correlation, strict=True
    ):
        if square > 1 + MISFIT_MOST or alike > CORRELATION_MOST:
            reasons.append(f"{name} is off by {np.sqrt(square):.2g} times its noise, lag-1 autocorrelation {alike:.2g}")
    return reasons


def _untrusted(weighed: Weighed) -> str:
    return (
        f"the posterior is not what was drawn from about its peak (Pareto k {weighed.pareto_k:.2g}, at most "
        f"{PARETO_K_MOST:g}; {weighed.effective:.0f} effective draws, at least {EFFECTIVE_LEAST:g})"
    )
