"""What is unknown of a motion: each number with what is known of it before, on a scale where that is normal(0, 1)."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion_load import SHAPE_TERMS
from bayes_tyre.inference.motion_runout import Ground, Rolling, ground_in_units
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2


class Before(NamedTuple):
    """What is known of a number before its record: normal with this location and scale, and why.

    NaN stands for what the rig file or the record's own rest before and after the step says (`priors_of`).
    """

    location: float
    scale: float
    reason: str


#: By name, in the order of the unknowns. Logarithms are natural. `log_settled` is log(x - k beta): the law loses
#: energy only where x > k beta, and so there is no other place to go.
BEFORE: dict[str, Before] = {
    "log_k": Before(np.log(1.0), 1.0, "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres, as `k_cell` of the fit"),
    "log_settled": Before(np.log(0.2), 1.0, "0.03 to 1.4 kN: 0.1 to 10 % of a truck tyre's load as friction"),
    "log_beta": Before(
        np.log(0.1), 1.5, "0.005 to 1.9 mm: below the travel between two samples to half a step's travel"
    ),
    "log_m": Before(np.nan, np.nan, "the rig file's effective mass and how well it is known"),
    "log_damping_ratio": Before(np.log(0.03), 1.0, "0.4 to 21 % of critical: what rubber and bearings do"),
    "C_kN": Before(0.0, 0.3, "the line through first touch; it moves the geometry by tenths of a mm, no force"),
    "rest_friction": Before(0.0, 1.0, "uniform between the settled branches: standard normal quantile of its place"),
    "load_before_kN": Before(np.nan, np.nan, "mean of the rest before the step, with its standard error"),
    "load_after_kN": Before(np.nan, np.nan, "mean after the window, with its standard error"),
    "laser_at_rest_mm": Before(np.nan, np.nan, "mean of the rest before the step, with its standard error"),
    "acceleration_offset_m_per_s2": Before(np.nan, np.nan, "mean of the rest before the step, with its standard error"),
    "ramp_start_s": Before(np.nan, 0.02, "where a straight ramp begins that fits the load: off by a tenth of a rise"),
    "log_rise": Before(np.nan, 0.5, "that ramp's length, a factor of 2.7 about it: the load cell is coarse"),
    "shape_bend_onset": Before(
        0.0, 0.5, "1 standard deviation from a raised cosine's onset to about a straight ramp's"
    ),
    "shape_bend_end": Before(0.0, 0.5, "as at the onset: from smooth to a lag's slow end"),
    "shape_even": Before(0.0, 0.15, "about 1 % of the step at its middle: what the bends leave of the usual shapes"),
    "shape_odd": Before(0.0, 0.15, "as the even one"),
}
NAMES = tuple(BEFORE)
_AT = {name: index for index, name in enumerate(NAMES)}


class Unknowns(NamedTuple):
    """The unknowns of a motion, in units.

    Attributes
    ----------
    law:
        The tyre's, x > k beta.
    m_kg, c_kN_s_per_mm:
        Mass and damping at the wheel centre.
    rest_friction_kN:
        Force of the tyre at rest less k d + C, on flat ground, within +-(x - k beta).
    load_kN:
        Of the cylinder before and after the step, shape (2,).
    laser_mm, acceleration_m_per_s2:
        Readings of laser and accelerometer at rest before the step.
    start_s, rise_s, shape:
        Of the load's step (`load_share`), from the start of the window.
    ground:
        Under a rolling tyre; None where it stands. Of a rolling tyre `rest_friction_kN` is the friction at the
        window's start, and `laser_mm` the reading on the middle line with no runout.
    """

    law: Fancher
    m_kg: Array
    c_kN_s_per_mm: Array
    rest_friction_kN: Array
    load_kN: Array
    laser_mm: Array
    acceleration_m_per_s2: Array
    start_s: Array
    rise_s: Array
    shape: Array
    ground: Ground | None = None


def in_units(
    rig: Rig,
    standard: Float[Array, " unknowns"],
    prior: Float[ArrayLike, "2 unknowns"],
    rolling: Rolling | None = None,
) -> Unknowns:
    """Return the unknowns in units from the standard ones, whose prior is normal(0, 1), independent.

    Parameters
    ----------
    rig:
        For the stiffness at the wheel centre, which critical damping refers to.
    standard:
        Shape (unknowns,), in the order of `NAMES`; of a rolling tyre `motion_runout.ground_names` follow.
    prior:
        Locations and scales, shape (2, unknowns).
    rolling:
        What the further unknowns of a rolling tyre belong to.
    """
    location, scale = jnp.asarray(prior)
    value = location + scale * standard
    k, settled, beta, m, ratio = (jnp.exp(value[i]) for i in range(5))
    rest = settled * jax.scipy.special.erf(value[_AT["rest_friction"]] / np.sqrt(2))
    at_wheel_centre = k * geometry.curvature_factor(rig)
    return Unknowns(
        law=Fancher(k=k, C=value[_AT["C_kN"]], x=settled + k * beta, beta=beta),
        m_kg=m,
        c_kN_s_per_mm=2 * ratio * jnp.sqrt(at_wheel_centre * m * KN_PER_KG_MM_PER_S2),
        rest_friction_kN=rest,
        load_kN=value[_AT["load_before_kN"] : _AT["load_after_kN"] + 1],
        laser_mm=value[_AT["laser_at_rest_mm"]],
        acceleration_m_per_s2=value[_AT["acceleration_offset_m_per_s2"]],
        start_s=value[_AT["ramp_start_s"]],
        rise_s=jnp.exp(value[_AT["log_rise"]]),
        shape=value[_AT["shape_bend_onset"] : _AT["shape_bend_onset"] + SHAPE_TERMS],
        ground=None if rolling is None else ground_in_units(value[len(NAMES) :], rolling),
    )


def priors_of(rig: Rig, known: dict[str, tuple[float, float]]) -> Float[np.ndarray, "2 unknowns"]:
    """Return locations and scales of all unknowns, shape (2, unknowns).

    Parameters
    ----------
    rig:
        Effective mass and its relative standard deviation.
    known:
        What the record says of its own levels and ramp: location and scale by name; a NaN scale leaves `BEFORE`'s.
    """
    axle = rig.axle
    mass = {"log_m": (np.log(axle.effective_mass_kg), axle.effective_mass_relative_sd)}
    table = np.array([[before.location, before.scale] for before in BEFORE.values()])
    for name, (location, scale) in (mass | known).items():
        table[_AT[name]] = location, table[_AT[name], 1] if np.isnan(scale) else scale
    return table.T
