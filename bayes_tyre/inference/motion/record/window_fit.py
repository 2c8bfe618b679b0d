"""The fit of a window: the MAP estimate of its motion, with what acts on the axle beside load, runout and law."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.record.disturbance.force_discrepancy import force_columns
from bayes_tyre.inference.motion.record.disturbance.load_departure import (
    LoadDeparture,
    load_departure,
    with_load_departure,
)
from bayes_tyre.inference.motion.record.disturbance.matern_process import MOST_SHARE
from bayes_tyre.inference.motion.record.disturbance.response import Columns, disturbance_response
from bayes_tyre.inference.motion.record.disturbance.road_roughness import (
    of_known_size,
    road_response,
    wave_count,
    with_residual_noise,
    with_road_noise,
)
from bayes_tyre.inference.motion.record.evidence import log_evidence
from bayes_tyre.inference.motion.record.map_fit import (
    AT_PEAK,
    ROUGH_TOLERANCE,
    MapEstimate,
    fit_map,
    refine_map,
    rough_map,
    starting_points,
    value_and_jacobian,
)
from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.second_mode import SHOWS, SHOWS_ON_ROAD, largest_line
from bayes_tyre.inference.motion.record.model.window import Disturbance, Window
from bayes_tyre.rig.axle import Rig

#: Tolerance of the last fit with a disturbance, in prior standard deviations: reversals of friction leave kinks.
DISTURBED_TOLERANCE = 1e-4
#: Squared step, in posterior standard deviations, at which a fit with a force has converged (`AT_PEAK`).
#: Its response is linear about one motion, and reversals of friction near rest are kinks that stop the solver before.
#: What is drawn about the point is weighted by its density.
FORCED_AT_PEAK = 0.1
#: How many times as probable as none a departure of the load is to be where the motion does not fit without one.
EVEN_ODDS = 1.0
#: Fits with the force that load and law leave out, each about the force of the one before: so many, and more where none
#: has converged.
FORCE_ROUNDS, MOST_FORCE_ROUNDS = 3, 6
#: Fits on a road with a load's departure, each about the departure of the one before, at least and at most.
DEPARTURE_ROUNDS = 2, 5


class Fit(NamedTuple):
    """The fit of a window.

    Attributes
    ----------
    window:
        With what acts on the axle beside load, runout and law.
    estimate:
        Of its motion.
    without_force:
        Covariance of the standardised parameters if it were certain that load and law leave out no force; None: none is
        left out.
    possible:
        Columns of a force, whether or not one is left out.
    known:
        Columns of a disturbance of known size, with weights of standard deviation 1; None: there is none.
    departs_unseen:
        Whether the motion asks for a departure of the load that the load cell does not show by itself.
    """

    window: Window
    estimate: MapEstimate
    without_force: Float[ArrayLike, "parameters parameters"] | None
    possible: Columns
    known: Disturbance | None
    departs_unseen: bool = False


def fit_window(rig: Rig, window: Window) -> Fit:
    """Return the fit of a window, with the road under a rolling tyre, and what load and law leave out.

    The load's departure from its shape is kept where the load cell shows it, unless a load that rings is more probable.
    A coarse cell may not show a departure where the motion does: without one it is then fitted badly or not at all. One
    of the size that the cell's readings make most probable, however little more probable than none, may mend that.
    """
    departure = load_departure(rig, window)
    fit = _fit_with(rig, window, departure)
    if departure.size > 0:
        return _with_ringing(rig, window, departure, fit)
    if _fits(fit):
        return fit
    possible = load_departure(rig, window, EVEN_ODDS)
    other = _fit_with(rig, window, possible) if possible.size > 0 else fit
    return other._replace(departs_unseen=True) if _fits(other) else fit


def _with_ringing(rig: Rig, window: Window, departure: LoadDeparture, fit: Fit) -> Fit:
    """Return the fit with a load that rings where that is more probable, first by the cell alone, then by all readings.

    To a coarse cell two stages may look like ringing. The motion tells them apart.
    """
    rings = window.with_ringing()
    further = load_departure(rig, rings)
    if further.log_evidence <= departure.log_evidence:
        return fit
    other = _fit_with(rig, rings, further)
    return other if _log_evidence(other) > _log_evidence(fit) else fit


def _log_evidence(fit: Fit) -> float:
    return float(np.nan_to_num(log_evidence(fit.window, fit.estimate, None), nan=-np.inf))


def fit_about(rig: Rig, fit: Fit, estimate: MapEstimate) -> Fit:
    """Return the fit about another peak of its posterior: the response to what is left out is taken there."""
    to_integrate = fit.known is not None
    about = _with_force(rig, fit.window, estimate, fit.possible, fit.known, to_integrate=to_integrate)
    return about._replace(departs_unseen=fit.departs_unseen)


def _fits(fit: Fit) -> bool:
    return bool(fit.estimate.converged) and not np.any(fit.estimate.misfits)


def _fit_with(rig: Rig, window: Window, departure: LoadDeparture) -> Fit:
    """Return the fit of a window with a departure of its load, if that has a size.

    Under a rolling tyre it is integrated out together with the road from the beginning.
    """
    starts, departs = starting_points(rig, window), bool(departure.size > 0)
    if departs or window.ringing_at:
        starts = starts + np.asarray(departure.standard)
    if departs:
        window = with_load_departure(window, departure)
    known = departure.columns if departs else None
    if window.rolling is None:
        window, estimate = _with_second_mode(rig, window, fit_map(rig, window, starts))
    else:
        window, estimate, known = _fit_on_road(rig, window, starts, known)
    possible = force_columns(rig, window, estimate.standard)
    return _with_force(rig, window, estimate, possible, known, to_integrate=departs and window.rolling is None)


def _fit_on_road(
    rig: Rig, window: Window, starts: Float[np.ndarray, "starts parameters"], known: Disturbance | None
) -> tuple[Window, MapEstimate, Disturbance]:
    """Return window and estimate of a rolling tyre, and the columns of its road and of what was `known`.

    With a second mode where a rough fit without one, before the road takes part of it up, shows it; and if it explains
    what showed it.
    """
    standard, waves = rough_map(rig, window, starts), wave_count(window)
    if window.in_units(rig, standard).mode is None:
        line_Hz, power = _line_left(rig, window, standard)
        if power > SHOWS_ON_ROAD:
            extended = window.with_mode(line_Hz)
            further = extended.prior.shape[1] - starts.shape[1]
            with_mode = _fit_on_road(rig, extended, np.pad(starts, ((0, 0), (0, further))), known)
            if with_mode[1].converged and _line_left(rig, with_mode[0], with_mode[1].standard)[1] < SHOWS_ON_ROAD:
                return with_mode
    road = road_response(rig, window, standard, waves, known)
    window = window._replace(disturbance=road)
    rough = refine_map(rig, window, standard, ROUGH_TOLERANCE)
    # The first road's weights belong to responses in narrower noise; its estimate in mm is the same.
    window = with_road_noise(rig, with_residual_noise(window, rough), rough.standard, road.size)
    # The cell's estimate of a departure is far from the motion's: then again about that.
    rounds, at_peak = ((1, 1), AT_PEAK) if known is None else (DEPARTURE_ROUNDS, FORCED_AT_PEAK)
    estimate = rough
    for number in range(rounds[1]):
        road = road_response(rig, window, estimate.standard, waves, known)
        window = window._replace(disturbance=road)
        estimate = refine_map(rig, window, estimate.standard, DISTURBED_TOLERANCE, at_peak)
        if number + 1 >= rounds[0] and estimate.converged:
            break
    road, columns = of_known_size(window, road, waves)
    if known is not None:
        columns = jax.tree.map(lambda *each: jnp.concatenate(each), columns, known)
    return window._replace(disturbance=road), estimate, columns


def _line_left(rig: Rig, window: Window, standard: Float[ArrayLike, " parameters"]) -> tuple[float, float]:
    """Return frequency and relative power of the largest line in what a fit leaves of the acceleration."""
    left = np.asarray(_residuals(rig, jnp.asarray(standard), window))
    return largest_line(left[: window.readings.shape[-1]], float(window.block_s))


_residuals = jax.jit(residuals, static_argnums=0)


def _with_force(
    rig: Rig, window: Window, estimate: MapEstimate, among: Columns, known: Disturbance | None, *, to_integrate: bool
) -> Fit:
    """Return the fit with the force that load and law leave out.

    A force that only the motion shows is kept where it is small and the fit converges with it: far from the true motion
    its linear response says nothing.

    Parameters
    ----------
    rig, window, estimate:
        The fit without it.
    among:
        Columns of the force.
    known:
        Columns of the disturbance of the window; None: it has none.
    to_integrate:
        Whether that disturbance is still the load cell's own estimate, and to be integrated out even without a force.
    """
    none = among._replace(sizes=jnp.zeros_like(among.sizes))
    kept = forced, refined = window, estimate
    settled = bool(estimate.converged) and not to_integrate
    # With the cell's estimate of a departure the first fit is far from the motion, and a force would take that up.
    for number, possible in enumerate((*[none] * to_integrate, *[among] * MOST_FORCE_ROUNDS)):
        force = disturbance_response(rig, forced, refined.standard, possible, known)
        if not (to_integrate or force.size > 0):
            break
        forced = forced._replace(disturbance=force._replace(force_size=force.size))
        refined = refine_map(rig, forced, refined.standard, DISTURBED_TOLERANCE, FORCED_AT_PEAK)
        if force.size < MOST_SHARE and (refined.converged or (to_integrate and not settled)):
            kept, settled = (forced, refined), bool(refined.converged)
        if number + 1 >= FORCE_ROUNDS + to_integrate and settled:
            break
    window, estimate = kept[0], jax.tree.map(np.asarray, kept[1])
    without_force = None
    if window.disturbance is not None and jnp.asarray(window.disturbance.force_size) > 0:
        # A response to nothing at all is not a number.
        unforced = None if known is None else disturbance_response(rig, window, estimate.standard, none, known)
        without_force = _covariance(rig, window._replace(disturbance=unforced), estimate.standard)
    return Fit(window, estimate, without_force, among, known)


@functools.partial(jax.jit, static_argnums=0)
def _covariance(rig: Rig, window: Window, standard: Float[ArrayLike, " parameters"]) -> Array:
    """Return the covariance of the standardised parameters about a point, by the Gauss-Newton Hessian."""
    jacobian = value_and_jacobian(rig, jnp.asarray(standard), window)[1]
    return jnp.linalg.inv(jacobian.T @ jacobian)


def _with_second_mode(rig: Rig, window: Window, estimate: MapEstimate) -> tuple[Window, MapEstimate]:
    """Return window and estimate with a second mode where what is left of the acceleration shows one.

    It is kept where it explains what showed it. A mode that the rig file states is fitted from the beginning.
    """
    if rig.second_mode is not None or not float(estimate.ringing_power) > SHOWS:
        return window, estimate
    extended = window.with_mode(float(estimate.ringing_Hz))
    start = jnp.pad(jnp.asarray(estimate.standard), (0, extended.prior.shape[1] - len(estimate.standard)))
    refined = refine_map(rig, extended, start)
    gone = bool(refined.converged) and float(refined.ringing_power) < SHOWS
    return (extended, refined) if gone else (window, estimate)
