"""What one record's motion gives beside its known truth: parameters, and what a cycle loses, with intervals."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.cycle.energy import Losses, losses_from_reported
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.results.figure_data.hysteresis_loops import loop_table, settled_friction
from bayes_tyre.rig.axle import Rig

#: Name and unit, in the order of the logarithms, and of the losses.
PARAMETERS = (("k", "kN/mm"), ("x", "kN"), ("beta", "mm"), ("m", "kg"), ("c", "kN s/mm"))
LOSSES = (
    *(("energy a cycle", "J"), ("loss factor", "")),
    *(("equivalent damping", "kN s/mm"), ("separation 2 (x - k beta)", "kN")),
)


def beside_truth(
    rig: Rig,
    log_draws: Float[np.ndarray, "draws 5"],
    weights: Float[np.ndarray, " draws"],
    truth: Float[np.ndarray, "5"],
    displacement_mm: float,
    amplitude_mm: float,
    interval: float = 0.95,
) -> pd.DataFrame:
    """Return a row a quantity: `quantity`, `unit`, `truth`, `median`, `lower`, `upper`.

    Parameters
    ----------
    rig:
        For the losses at the wheel centre.
    log_draws, weights:
        As a `MotionEstimate` has them: logarithms of k, x, beta, m and c, and what each draw weighs.
    truth:
        True k (kN/mm), x (kN), beta (mm), m (kg), c (kN s/mm).
    displacement_mm, amplitude_mm:
        The cycle's middle and half its stroke, at the wheel centre.
    interval:
        Probability between `lower` and `upper`, equal-tailed.
    """
    lost = losses_of_logs(rig, log_draws, displacement_mm, amplitude_mm)
    draws = np.column_stack([np.exp(log_draws), *map(np.asarray, lost)])
    true_losses = losses_of_logs(rig, np.log(truth), displacement_mm, amplitude_mm)
    tails = ((1.0 - interval) / 2.0, 0.5, (1.0 + interval) / 2.0)
    lower, median, upper = np.array([_quantiles(values, weights, tails) for values in draws.T]).T
    names, units = zip(*PARAMETERS, *LOSSES, strict=True)
    table = {"quantity": names, "unit": units, "truth": [*truth, *map(float, true_losses)]}
    return pd.DataFrame({**table, "median": median, "lower": lower, "upper": upper})


def true_loop(k: float, x: float, beta: float, amplitude_mm: float) -> pd.DataFrame:
    """Return the settled loop of known k (kN/mm), x (kN) and beta (mm): `branch`, `displacement_mm`, `median_kN`."""
    return loop_table(amplitude_mm, settled_friction(np.array([k]), np.array([x]), np.array([beta]), amplitude_mm)[0])


def _quantiles(
    values: Float[np.ndarray, " draws"], weights: Float[np.ndarray, " draws"], tails: tuple[float, ...]
) -> Float[np.ndarray, " tails"]:
    """Return quantiles of weighed draws: each draw stands in the middle of its weight."""
    order = np.argsort(values)
    weight = weights[order] / weights.sum()
    return np.interp(tails, np.cumsum(weight) - weight / 2, values[order])


def losses_of_logs(
    rig: Rig,
    logs: Float[ArrayLike, "*draws p"],
    displacement_mm: ScalarLike,
    amplitude_mm: ScalarLike,
    law: MotionLaw = FANCHER,
) -> Losses:
    """Return the losses of a cycle from the logarithms of a law's `reported_parameters`, one set or draws.

    The offset C is weakly identified by a motion and moves the geometry by tenths of a mm: it is set to 0. c is not
    included for a law with friction (`losses_from_reported`).

    Parameters
    ----------
    rig:
        Geometry.
    logs:
        Natural logarithms in the order of the law's `reported_parameters`, shape (..., p).
    displacement_mm, amplitude_mm:
        The cycle's middle and half its stroke at the wheel centre, mm.
    law:
        Of the tyre.

    Returns
    -------
    Shape (...) each.
    """
    logs = jnp.asarray(logs, float)

    def one(logs: Array) -> Losses:
        return losses_from_reported(rig, law, jnp.exp(logs), displacement_mm, amplitude_mm)

    flat = jax.vmap(one)(logs.reshape(-1, logs.shape[-1]))
    return Losses(*(values.reshape(logs.shape[:-1]) for values in flat))
