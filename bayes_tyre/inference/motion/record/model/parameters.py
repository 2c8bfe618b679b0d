"""The parameters of a motion and their priors, standardised so that each prior is normal(0, 1)."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.laws import EXTENSIONS, FANCHER, TYRE_PRIORS, MotionLaw, NormalPrior, extended
from bayes_tyre.inference.motion.record.model.load_ringing import RINGING_PRIORS, Ringing, ringing_in_units
from bayes_tyre.inference.motion.record.model.load_step import SHAPE_TERMS
from bayes_tyre.inference.motion.record.model.runout import Ground, Rolling, ground_in_units
from bayes_tyre.inference.motion.record.model.second_mode import MODE_PRIORS, SecondMode, mode_in_units
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import rest_displacement
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: Least standard deviation of the logarithm of the mass: one that a rig file says is exact is a prior all the same.
_LEAST_MASS_SD = 1e-4
#: Priors of the parameters that follow the tyre's own (`laws.TYRE_PRIORS`), by name, in order. Logarithms are natural.
RECORD_PRIORS: dict[str, NormalPrior] = {
    "log_m": NormalPrior(np.nan, np.nan, "the rig file's effective mass and how well it is known"),
    "log_damping_ratio": NormalPrior(np.log(0.03), 1.0, "0.4 to 21 % of critical: what rubber and bearings do"),
    "C_kN": NormalPrior(0.0, 0.3, "the line through first touch; it moves the geometry by tenths of a mm, no force"),
    "rest_friction": NormalPrior(
        0.0, 1.0, "uniform between the settled branches: standard normal quantile of its place; idle without friction"
    ),
    "load_before_kN": NormalPrior(np.nan, np.nan, "mean of the rest before the step, with its standard error"),
    "load_after_kN": NormalPrior(np.nan, np.nan, "mean after the window, with its standard error"),
    "laser_at_rest_mm": NormalPrior(np.nan, np.nan, "mean of the rest before the step, with its standard error"),
    "acceleration_offset_m_per_s2": NormalPrior(
        np.nan, np.nan, "mean of the rest before the step, with its standard error"
    ),
    "ramp_start_s": NormalPrior(
        np.nan, 0.02, "where a straight ramp begins that fits the load: off by a tenth of a rise"
    ),
    "log_rise": NormalPrior(np.nan, 0.5, "that ramp's length, a factor of 2.7 about it: the load cell is coarse"),
    "shape_bend_onset": NormalPrior(
        0.0, 0.5, "1 standard deviation from a raised cosine's onset to about a straight ramp's"
    ),
    "shape_bend_end": NormalPrior(0.0, 0.5, "as at the onset: from smooth to a lag's slow end"),
    "shape_even": NormalPrior(
        0.0, 0.15, "about 1 % of the step at its middle: what the bends leave of the usual shapes"
    ),
    "shape_odd": NormalPrior(0.0, 0.15, "as the even one"),
    "laser_delay_s": NormalPrior(np.nan, np.nan, "the rig file's: a laser averages, filters and sends"),
    "load_delay_s": NormalPrior(np.nan, np.nan, "the rig file's: a load cell's amplifier filters"),
}


def parameter_names(law: MotionLaw) -> tuple[str, ...]:
    """Return the names of the parameters of a motion on a law, in order.

    Those of a rolling tyre's ground follow, of a load that rings (`load_ringing`), of a second mode of the rig
    (`second_mode`), where a record has them.
    """
    return (*(f"log_{name}" for name in law.tyre_parameters), *RECORD_PRIORS, *law.extensions)


class MotionParameters(NamedTuple):
    """The parameters of a motion, in physical units.

    Attributes
    ----------
    law:
        Of the tyre, with the middle line k d + C; Fancher's has x > k beta.
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
    laser_delay_s, load_delay_s:
        How late laser and load cell read, behind the accelerometer.
    ground:
        Under a rolling tyre; None for a stationary one. For a rolling tyre `rest_friction_kN` is the friction at the
        window's start, and `laser_mm` the reading on the middle line with no runout.
    ringing:
        Of a load that rings; None of one that does not.
    mode:
        A second mode that the sensors show; None without one.
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
    laser_delay_s: Array
    load_delay_s: Array
    ground: Ground | None = None
    ringing: Ringing | None = None
    mode: SecondMode | None = None


def in_units(
    rig: Rig,
    standard: Float[Array, " parameters"],
    prior: Float[ArrayLike, "2 parameters"],
    rolling: Rolling | None = None,
    law: MotionLaw = FANCHER,
) -> MotionParameters:
    """Return the parameters in physical units from the standardised ones, whose priors are independent normal(0, 1).

    Parameters
    ----------
    rig:
        For the stiffness at the wheel centre, which critical damping refers to.
    standard:
        Shape (parameters,), in the order of `parameter_names` and what it says follows them. A load's ringing has four
        parameters and a second mode three: their number says which of the two a record has.
    prior:
        Means and standard deviations, shape (2, parameters).
    rolling:
        Harmonics of a rolling tyre; None for a stationary one.
    law:
        Force law of the tyre.
    """
    names = parameter_names(law)
    at = {name: index for index, name in enumerate(names)}
    mean, sd = jnp.asarray(prior)
    value = mean + sd * standard
    of_ground = 0 if rolling is None else rolling.ground_parameters
    ground, further = jnp.split(value[len(names) :], [of_ground])
    ringing, mode = _ringing_and_mode(further)
    k, m, ratio = (jnp.exp(value[at[name]]) for name in ("log_k", "log_m", "log_damping_ratio"))
    rest = jnp.zeros(())
    if law.has_friction:
        settled = jnp.exp(value[at["log_settled"]])
        rest = settled * jax.scipy.special.erf(value[at["rest_friction"]] / np.sqrt(2))
    at_wheel_centre = k * geometry.curvature_factor(rig)
    load_kN = value[at["load_before_kN"] : at["load_after_kN"] + 1]
    tyre = law.from_logs(value[: len(law.tyre_parameters)], value[at["C_kN"]])
    if law.extensions and isinstance(tyre, Fancher):
        before, after = (_rest_on_flat(rig, load, k, jnp.add(tyre.C, rest)) for load in load_kN)
        tyre = extended(tyre, {name: value[at[name]] for name in law.extensions}, (before, after))
    return MotionParameters(
        law=tyre,
        m_kg=m,
        c_kN_s_per_mm=2 * ratio * jnp.sqrt(at_wheel_centre * m * KN_PER_KG_MM_PER_S2),
        rest_friction_kN=rest,
        load_kN=load_kN,
        laser_mm=value[at["laser_at_rest_mm"]],
        acceleration_m_per_s2=value[at["acceleration_offset_m_per_s2"]],
        start_s=value[at["ramp_start_s"]],
        rise_s=jnp.exp(value[at["log_rise"]]),
        shape=value[at["shape_bend_onset"] : at["shape_bend_onset"] + SHAPE_TERMS],
        laser_delay_s=value[at["laser_delay_s"]],
        load_delay_s=value[at["load_delay_s"]],
        ground=None if rolling is None else ground_in_units(ground, rolling),
        ringing=ringing,
        mode=mode,
    )


def _ringing_and_mode(values: Float[Array, " further"]) -> tuple[Ringing | None, SecondMode | None]:
    """Return a load's ringing and a second mode from what follows all other parameters."""
    of_ringing = ringing_parameters(len(values))
    ringing = ringing_in_units(values[:of_ringing]) if of_ringing else None
    return ringing, mode_in_units(values[of_ringing:]) if len(values) > of_ringing else None


def ringing_parameters(further: int) -> int:
    """Return how many of so many parameters, which follow all others, are a load's ringing: it comes before a mode."""
    rings = further in (len(RINGING_PRIORS), len(RINGING_PRIORS) + len(MODE_PRIORS))
    return len(RINGING_PRIORS) if rings else 0


def _rest_on_flat(rig: Rig, load_kN: ScalarLike, k: ScalarLike, offset_kN: ScalarLike) -> Array:
    """Return the displacement on flat ground, mm, at which ``k d + offset`` carries a load of the cylinder, kN."""
    applied = jnp.asarray(geometry.tyre_load(rig, load_kN))
    return jnp.asarray(
        geometry.flat_ground_displacement(rig, rest_displacement(rig, applied, k=k, offset_kN=offset_kN))
    )


def prior_moments(
    rig: Rig, levels: dict[str, tuple[float, float]], law: MotionLaw = FANCHER
) -> Float[np.ndarray, "2 parameters"]:
    """Return prior means and standard deviations of all parameters, shape (2, parameters).

    Parameters
    ----------
    rig:
        Effective mass and delays of the sensors, with their standard deviations.
    levels:
        Mean and standard deviation of the record's own levels and ramp, by name; NaN keeps that of `RECORD_PRIORS`.
    law:
        Force law of the tyre; its parameters come first.
    """
    axle, sensors = rig.axle, rig.sensors
    of_rig = {
        "log_m": (np.log(axle.effective_mass_kg), max(axle.effective_mass_relative_sd, _LEAST_MASS_SD)),
        "laser_delay_s": (1e-3 * sensors.displacement_delay_ms, 1e-3 * sensors.displacement_delay_sd_ms),
        "load_delay_s": (1e-3 * sensors.load_delay_ms, 1e-3 * sensors.load_delay_sd_ms),
    }
    priors = [*(TYRE_PRIORS[name] for name in law.tyre_parameters), *RECORD_PRIORS.values()]
    priors += [EXTENSIONS[name].prior for name in law.extensions]
    table, names = np.array([[prior.mean, prior.sd] for prior in priors]), parameter_names(law)
    for name, (mean, sd) in (of_rig | levels).items():
        row = names.index(name)
        table[row] = mean, table[row, 1] if np.isnan(sd) else sd
    return table.T
