"""The hysteresis loop of a tyre in a cycle of displacement, from a posterior of motions."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import ArrayLike, Float

from bayes_tyre.inference.sampling.group_means import group_means
from bayes_tyre.laws.fancher import small_step_limit
from bayes_tyre.results.equal_tailed import median_lower_upper

#: The law that these loops are of, as a result names it.
LAW = "fancher"
#: Points of a branch; draws that the bands are made of.
_POINTS, _DRAWS = 121, 500


def friction_loops(tree: xr.DataTree, interval: float = 0.95) -> pd.DataFrame:
    """Return the settled loop of each configuration and direction, the force of the middle line k d + C taken off.

    The loop of the mean parameters over the cases, at every draw; its half stroke is the posterior's `amplitude_mm`,
    here on flat ground, where k, x and beta are stated.

    Parameters
    ----------
    tree:
        A posterior of motions.
    interval:
        Probability between `lower_kN` and `upper_kN`, equal-tailed.

    Returns
    -------
    pandas.DataFrame
        `configuration`, `direction` (of the step), `branch` (``growing`` or ``falling`` displacement),
        `displacement_mm` from the middle, `median_kN`, `lower_kN`, `upper_kN`.
    """
    means, amplitude = group_means(tree), float(tree.attrs["amplitude_mm"])
    blocks = []
    for group in range(means.sizes["group"]):
        mean = means.isel(group=group)
        k, x, beta = (mean[name].to_numpy().ravel() for name in ("k", "x", "beta"))
        some = slice(None, None, max(1, len(k) // _DRAWS))
        friction = settled_friction(k[some], x[some], beta[some], amplitude)
        median, lower, upper = median_lower_upper(friction, interval)
        factors = {factor: str(mean[factor].item()) for factor in ("configuration", "direction")}
        blocks.append(loop_table(amplitude, median).assign(**factors, lower_kN=lower, upper_kN=upper))
    return pd.concat(blocks, ignore_index=True)


def settled_friction(
    k: Float[ArrayLike, " draws"], x: Float[ArrayLike, " draws"], beta: Float[ArrayLike, " draws"], amplitude_mm: float
) -> Float[np.ndarray, "draws points"]:
    """Return the force less k d + C through a loop that repeats itself, kN: growing displacement, then falling."""
    k, x, beta = (jnp.asarray(value)[:, None] for value in (k, x, beta))
    d = jnp.asarray(_displacement(amplitude_mm))
    # It turns at +-(x - k beta) tanh(a / beta): see `laws.loop_energy.dissipated_energy_per_cycle`.
    turn = -k * amplitude_mm - (x - k * beta) * jnp.tanh(amplitude_mm / beta)
    force = small_step_limit(d, k=k, C=0.0, x=x, beta=beta, d_i=-amplitude_mm, F_i=turn)
    growing = np.asarray(force - k * d)
    return np.concatenate([growing, -growing], axis=1)


def _displacement(amplitude_mm: float) -> Float[np.ndarray, " points"]:
    """Return displacements of a branch, closest where it turns."""
    return -amplitude_mm * np.cos(np.linspace(0.0, np.pi, _POINTS))


def loop_table(amplitude_mm: float, friction: Float[np.ndarray, " points"]) -> pd.DataFrame:
    """Return one loop as `branch`, `displacement_mm` and `median_kN`, from the result of `settled_friction`."""
    d = _displacement(amplitude_mm)
    branch = np.repeat(["growing", "falling"], _POINTS)
    return pd.DataFrame({"branch": branch, "displacement_mm": np.concatenate([d, -d]), "median_kN": friction})
