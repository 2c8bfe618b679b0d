"""The checks of one record's estimate: why it is not to be trusted as it stands."""

import jax.numpy as jnp
import numpy as np

from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST
from bayes_tyre.inference.motion.record.disturbance.force_discrepancy import load_step_kN
from bayes_tyre.inference.motion.record.disturbance.linearity import linear_response_error
from bayes_tyre.inference.motion.record.importance_sampling import EFFECTIVE_LEAST, WeightedDraws
from bayes_tyre.inference.motion.record.map_fit import MapEstimate
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.inference.motion.record.window_fit import Fit
from bayes_tyre.rig.axle import Rig

#: Above this share of the load's step the force that load and law leave out indicates a misfit. In simulated records
#: without a mismatch it is 0; of other laws it is above, and x and beta are not those of the law (docs/validation.md).
DISCREPANCY_MOST = 7e-4
#: Above this standard deviation of the log density's error fewer than e^-1 of the draws of a linear response to a
#: load's departure would count as draws from the posterior.
LINEAR_ERROR_MOST = 1.0
NOT_LINEAR = "the readings' response to the load's departure from its shape is not linear, as it is taken to be"


def failed_checks(rig: Rig, fit: Fit, weighted: WeightedDraws, *, about_peak: bool) -> list[str]:
    """Return the failed checks of a record's estimate.

    Parameters
    ----------
    rig:
        Geometry.
    fit, weighted:
        Of the record, and the draws about its peak.
    about_peak:
        Whether the estimate rests on the peak, as its draws are not trusted.
    """
    error = linear_response_error(rig, fit.window, weighted.standard, weighted.weights)
    return [
        *["the fit did not converge"] * (about_peak and not fit.estimate.converged),
        *misfits(rig, fit.window, fit.estimate),
        *[_departs_unseen(sizes_left_out(fit.window)[1])] * fit.departs_unseen,
        *[_untrusted(weighted)] * about_peak,
        *[_not_linear(error)] * (not error <= LINEAR_ERROR_MOST),
    ]


def misfits(rig: Rig, window: Window, estimate: MapEstimate) -> list[str]:
    """Return what the readings of a fit are off by: channels beyond their noise, and a force that is left out."""
    reasons = []
    channels = ("acceleration", "laser", "load")
    for name, misfit, square, correlation in zip(
        channels, estimate.misfits, estimate.chi_squared, estimate.correlation, strict=True
    ):
        if misfit:
            reasons.append(
                f"{name} is off by {np.sqrt(square):.2g} times its noise, lag-1 autocorrelation {correlation:.2g}"
            )
    if (share := sizes_left_out(window)[0]) > DISCREPANCY_MOST:
        parameters = window.in_units(rig, jnp.asarray(estimate.standard))
        reasons.append(
            f"load and law leave out a force of {share * float(load_step_kN(rig, parameters)):.2g} kN, "
            f"{100 * share:.2g} % of the load's step (at most {100 * DISCREPANCY_MOST:g} %)"
        )
    return reasons


def sizes_left_out(window: Window) -> tuple[float, float]:
    """Return the sizes of the force that load and law leave out, and of the load's departure, as shares of its step."""
    if window.disturbance is None:
        return 0.0, 0.0
    return float(jnp.asarray(window.disturbance.force_size)), float(jnp.asarray(window.disturbance.load_size))


def _departs_unseen(share: float) -> str:
    return (
        f"the motion fits only if the load departs from its shape by {100 * share:.2g} % of its step, which the load "
        "cell does not show by itself"
    )


def _not_linear(error: float) -> str:
    return f"{NOT_LINEAR}: the log density is off by {error:.3g} (at most {LINEAR_ERROR_MOST:g})"


def _untrusted(weighted: WeightedDraws) -> str:
    return (
        f"the posterior is not what was drawn from about its peak (Pareto k {weighted.pareto_k:.2g}, at most "
        f"{PARETO_K_MOST:g}; {weighted.effective:.0f} effective draws, at least {EFFECTIVE_LEAST:g})"
    )
