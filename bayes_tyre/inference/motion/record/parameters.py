"""What is unknown of a motion: each number with what is known of it before, on a scale where that is normal(0, 1)."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.laws import FANCHER, OF_TYRES, Before, MotionLaw
from bayes_tyre.inference.motion.record.load_step import SHAPE_TERMS
from bayes_tyre.inference.motion.record.runout import Ground, Rolling, ground_in_units
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2

#: What is unknown behind the tyre's own parameters (`motion_laws.OF_TYRES`), by name, in the order of the unknowns.
#: Logarithms are natural.
BEFORE: dict[str, Before] = {
    "log_m": Before(np.nan, np.nan, "the rig file's effective mass and how well it is known"),
    "log_damping_ratio": Before(np.log(0.03), 1.0, "0.4 to 21 % of critical: what rubber and bearings do"),
    "C_kN": Before(0.0, 0.3, "the line through first touch; it moves the geometry by tenths of a mm, no force"),
    "rest_friction": Before(
        0.0, 1.0, "uniform between the settled branches: standard normal quantile of its place; idle without friction"
    ),
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


def names_of(law: MotionLaw) -> tuple[str, ...]:
    """Return the names of the unknowns of a motion on a law, in their order; of a rolling tyre more follow."""
    return (*(f"log_{name}" for name in law.unknowns), *BEFORE)


#: The names with Fancher's law.
NAMES = names_of(FANCHER)


class Unknowns(NamedTuple):
    """The unknowns of a motion, in units.

    Attributes
    ----------
    law:
        The tyre's, with a line k d + C in its middle; Fancher's has x > k beta.
    m_kg, c_kN_s_per_mm:
        Mass and damping at the wheel centre.
    rest_friction_kN:
        Force of the tyre at rest less k d + C, on flat ground, between the settled branches; 0 without friction.
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

    law: Any
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
    law: MotionLaw = FANCHER,
) -> Unknowns:
    """Return the unknowns in units from the standard ones, whose prior is normal(0, 1), independent.

    Parameters
    ----------
    rig:
        For the stiffness at the wheel centre, which critical damping refers to.
    standard:
        Shape (unknowns,), in the order of `names_of`; of a rolling tyre `motion_runout.ground_names` follow.
    prior:
        Locations and scales, shape (2, unknowns).
    rolling:
        What the further unknowns of a rolling tyre belong to.
    law:
        How the tyre's law is made of its unknowns.
    """
    names = names_of(law)
    at = {name: index for index, name in enumerate(names)}
    location, scale = jnp.asarray(prior)
    value = location + scale * standard
    k, m, ratio = (jnp.exp(value[at[name]]) for name in ("log_k", "log_m", "log_damping_ratio"))
    rest = jnp.zeros(())
    if law.has_friction:
        settled = jnp.exp(value[at["log_settled"]])
        rest = settled * jax.scipy.special.erf(value[at["rest_friction"]] / np.sqrt(2))
    at_wheel_centre = k * geometry.curvature_factor(rig)
    return Unknowns(
        law=law.of_logs(value[: len(law.unknowns)], value[at["C_kN"]]),
        m_kg=m,
        c_kN_s_per_mm=2 * ratio * jnp.sqrt(at_wheel_centre * m * KN_PER_KG_MM_PER_S2),
        rest_friction_kN=rest,
        load_kN=value[at["load_before_kN"] : at["load_after_kN"] + 1],
        laser_mm=value[at["laser_at_rest_mm"]],
        acceleration_m_per_s2=value[at["acceleration_offset_m_per_s2"]],
        start_s=value[at["ramp_start_s"]],
        rise_s=jnp.exp(value[at["log_rise"]]),
        shape=value[at["shape_bend_onset"] : at["shape_bend_onset"] + SHAPE_TERMS],
        ground=None if rolling is None else ground_in_units(value[len(names) :], rolling),
    )


def priors_of(
    rig: Rig, known: dict[str, tuple[float, float]], law: MotionLaw = FANCHER
) -> Float[np.ndarray, "2 unknowns"]:
    """Return locations and scales of all unknowns, shape (2, unknowns).

    Parameters
    ----------
    rig:
        Effective mass and its relative standard deviation.
    known:
        What the record says of its own levels and ramp: location and scale by name; a NaN scale leaves `BEFORE`'s.
    law:
        Whose parameters the first unknowns are.
    """
    axle = rig.axle
    mass = {"log_m": (np.log(axle.effective_mass_kg), axle.effective_mass_relative_sd)}
    before = [*(OF_TYRES[name] for name in law.unknowns), *BEFORE.values()]
    table, names = np.array([[each.location, each.scale] for each in before]), names_of(law)
    for name, (location, scale) in (mass | known).items():
        row = names.index(name)
        table[row] = location, table[row, 1] if np.isnan(scale) else scale
    return table.T
