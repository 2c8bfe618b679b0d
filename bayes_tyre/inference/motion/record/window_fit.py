"""The fit of a window: the MAP estimate of its motion, with what acts on the axle beside load, runout and law."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.motion.record.disturbance.force_discrepancy import force_columns
from bayes_tyre.inference.motion.record.disturbance.load_departure import load_departure, with_load_departure
from bayes_tyre.inference.motion.record.disturbance.matern_process import MOST_SHARE
from bayes_tyre.inference.motion.record.disturbance.response import disturbance_response
from bayes_tyre.inference.motion.record.disturbance.road_roughness import (
    road_response,
    wave_count,
    with_residual_noise,
    with_road_noise,
)
from bayes_tyre.inference.motion.record.map_fit import (
    ROUGH_TOLERANCE,
    MapEstimate,
    fit_map,
    refine_map,
    rough_map,
    starting_points,
)
from bayes_tyre.inference.motion.record.second_mode import SHOWS, mode_priors
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.rig.axle import Rig

#: Tolerance of the last fit with a disturbance, in prior standard deviations: reversals of friction leave kinks.
DISTURBED_TOLERANCE = 1e-4
#: Squared step, in posterior standard deviations, at which such a fit of a stationary record has converged (`AT_PEAK`).
#: Its response is linear about one motion, and reversals of friction near rest are kinks that stop the solver before.
#: What is drawn about the point is weighted by its density.
FORCED_AT_PEAK = 0.1
#: Fits of a stationary record with the force that load and law leave out, each about the force of the one before.
FORCE_ROUNDS = 3

type _Fit = tuple[Window, MapEstimate]


def fit_window(rig: Rig, window: Window) -> _Fit:
    """Return a window, with the response to road roughness where the tyre rolls, and its MAP estimate."""
    starts = starting_points(rig, window)
    if window.rolling is None:
        return _fit_stationary(rig, window, starts)
    standard, waves = rough_map(rig, window, starts), wave_count(window)
    road = road_response(rig, window, standard, waves)
    window = window._replace(disturbance=road)
    rough = refine_map(rig, window, standard, ROUGH_TOLERANCE)
    # The first road's weights belong to responses in narrower noise; its estimate in mm is the same.
    window = with_road_noise(rig, with_residual_noise(window, rough), rough.standard, road.size)
    window = window._replace(disturbance=road_response(rig, window, rough.standard, waves))
    return window, jax.tree.map(np.asarray, refine_map(rig, window, rough.standard, DISTURBED_TOLERANCE))


def _fit_stationary(rig: Rig, window: Window, starts: Float[np.ndarray, "starts parameters"]) -> _Fit:
    """Return window and estimate with the forces that the load's shape and the law leave out.

    A force that only the motion shows is kept where it is small and the fit converges with it: far from the true motion
    its linear response says nothing. The load's departure from its shape is kept in any case: the load cell shows it.
    """
    departure = load_departure(rig, window)
    departs = bool(departure.size > 0)
    if departs:
        window = with_load_departure(window, departure)
        starts = starts + np.asarray(departure.standard)
    window, estimate = _with_second_mode(rig, window, fit_map(rig, window, starts))
    among, further = force_columns(rig, window, estimate.standard), departure.columns if departs else None
    none = among._replace(sizes=jnp.zeros_like(among.sizes))
    kept = forced, refined = window, estimate
    # With the cell's estimate of a departure the first fit is far from the motion, and a force would take that up.
    for possible in (*[none] * departs, *[among] * FORCE_ROUNDS):
        force = disturbance_response(rig, forced, refined.standard, possible, further)
        if not (departs or force.size > 0):
            break
        forced = forced._replace(disturbance=force)
        refined = refine_map(rig, forced, refined.standard, DISTURBED_TOLERANCE, FORCED_AT_PEAK)
        if force.size < MOST_SHARE and (departs or refined.converged):
            kept = forced, refined
    return kept[0], jax.tree.map(np.asarray, kept[1])


def _with_second_mode(rig: Rig, window: Window, estimate: MapEstimate) -> _Fit:
    """Return window and estimate with a second mode where what is left of the acceleration shows one.

    It is kept where it explains what showed it. A mode that the rig file states is fitted from the beginning.
    """
    if rig.second_mode is not None or not float(estimate.ringing_power) > SHOWS:
        return window, estimate
    prior = mode_priors(float(estimate.ringing_Hz))
    extended = window._replace(prior=jnp.concatenate([jnp.asarray(window.prior), prior], axis=1))
    start = jnp.concatenate([jnp.asarray(estimate.standard), jnp.zeros(prior.shape[1])])
    refined = refine_map(rig, extended, start)
    gone = bool(refined.converged) and float(refined.ringing_power) < SHOWS
    return (extended, refined) if gone else (window, estimate)
