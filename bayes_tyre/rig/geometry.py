"""From cylinder and laser to the wheel centre, and from two rollers to flat ground (Eq. 3 to 10, appendix B4).

A rig without rollers stands on flat ground already: factor and sine are 1 there, and Eq. 7 to 9 change nothing.

Forces are in kN and displacements in mm, positive into the rollers. Functions take numpy or JAX arrays or plain
numbers of any shape, and work element by element. From a JAX array comes a JAX array; from numpy and numbers numpy:
what JAX does outside jit it compiles, and keeps, for every new length, and no two recordings are equally long.
"""

import math
import sys
from typing import Any

import numpy as np
from jaxtyping import Float

from bayes_tyre.rig.axle import Rig, needed

#: JAX's array has no name here: naming it imports JAX, which takes longer than processing the first raw files.
type Values = Float[Any, "..."]


def centre_height_mm(rig: Rig) -> float:
    """Return h (mm): the wheel centre above the roller axes when the tyre just touches. Source: Eq. 10.

    Raises
    ------
    BadInput
        If the rig has no rollers.
    """
    rollers, tyre = needed(rig.rollers, rig, "rollers"), needed(rig.tyre, rig, "tyre")
    return math.sqrt((rollers.radius_mm + tyre.unloaded_radius_mm) ** 2 - rollers.half_spacing_mm**2)


def curvature_factor(rig: Rig) -> float:
    """Return 2 (R_r / (R_r + R_t))^(1/3), printed as 1.168 (single) and 1.167 (dual); 1 on flat ground. Eq. 8, 9."""
    if rig.rollers is None:
        return 1.0
    radius = rig.rollers.radius_mm
    return 2 * math.cbrt(radius / (radius + needed(rig.tyre, rig, "tyre").unloaded_radius_mm))


def wheel_centre_force(rig: Rig, cylinder_kN: Values | float) -> Values:
    """Return the cylinder's share of the force at the wheel centre, kN; the axle's weight is not in it.

    Parameters
    ----------
    rig:
        Lever arms.
    cylinder_kN:
        Force of the hydraulic cylinder, kN, any shape.

    Returns
    -------
    Force, kN, of the same shape. Source: Eq. 3 and 4.
    """
    ratio = rig.axle.support_to_load_mm / rig.axle.support_to_wheel_centre_mm
    return _array(cylinder_kN) * ratio


def tyre_load(rig: Rig, cylinder_kN: Values | float) -> Values:
    """Return the force that the tyre carries at rest, kN: the cylinder's share and the axle's own load.

    Parameters
    ----------
    rig:
        Lever arms and axle load.
    cylinder_kN:
        Force of the hydraulic cylinder, kN, any shape.

    Returns
    -------
    Force, kN, of the same shape. Source: Eq. 3 and 4, appendix B2.
    """
    return wheel_centre_force(rig, cylinder_kN) + rig.axle.axle_load_kN


def wheel_centre_displacement(rig: Rig, measured_mm: Values | float) -> Values:
    """Return the displacement at the wheel centre, mm, of a straight axle.

    Parameters
    ----------
    rig:
        Lever arms.
    measured_mm:
        Displacement at the measurement point, mm, any shape. (The same ratio holds for velocity and acceleration.)

    Returns
    -------
    Displacement, mm, of the same shape. Source: Eq. 5 and 6.
    """
    ratio = rig.axle.support_to_wheel_centre_mm / rig.axle.support_to_measurement_mm
    return _array(measured_mm) * ratio


def force_relative_sd(rig: Rig) -> float:
    """Return the relative standard deviation of the factor on all forces: that of the load cell, and of its lever.

    The arm to the wheel centre divides forces and multiplies displacements, so that k has its error twice. Its variance
    counts twice here and in `displacement_relative_sd`: k then has all of it, and a force somewhat more than its own.
    """
    return math.hypot(rig.accuracy.load_relative_sd, _lever_relative_sd(rig, rig.axle.support_to_load_mm))


def displacement_relative_sd(rig: Rig) -> float:
    """Return the relative standard deviation of the factor on all displacements, as `force_relative_sd` does."""
    lever = _lever_relative_sd(rig, rig.axle.support_to_measurement_mm)
    return math.hypot(rig.accuracy.displacement_relative_sd, lever)


def _lever_relative_sd(rig: Rig, arm_mm: float) -> float:
    centre_mm, sd_mm = rig.axle.support_to_wheel_centre_mm, rig.accuracy.lever_arm_sd_mm
    return sd_mm * math.hypot(1 / arm_mm, math.sqrt(2) / centre_mm)


def sin_theta(rig: Rig, wheel_centre_mm: Values | float) -> Values:
    """Return the sine of the angle between the horizontal and the line from a roller's axis to the wheel centre.

    Parameters
    ----------
    rig:
        Radii and half spacing.
    wheel_centre_mm:
        Displacement of the wheel centre since first touch, mm, any shape.

    Returns
    -------
    Dimensionless, of the same shape; 1 on flat ground. Source: Eq. 10.
    """
    if rig.rollers is None:
        return _array(wheel_centre_mm) ** 0
    height = centre_height_mm(rig) - _array(wheel_centre_mm)
    squared = height**2 + rig.rollers.half_spacing_mm**2
    return height / (_jax().numpy.sqrt(squared) if _is_jax(squared) else np.sqrt(squared))


def flat_ground_displacement(rig: Rig, wheel_centre_mm: Values | float) -> Values:
    """Return the displacement as on flat ground, mm.

    Parameters
    ----------
    rig:
        Radii and half spacing.
    wheel_centre_mm:
        Displacement of the wheel centre since first touch, mm, any shape.

    Returns
    -------
    Displacement, mm, of the same shape. Source: Eq. 7.
    """
    return _array(wheel_centre_mm) * sin_theta(rig, wheel_centre_mm)


def flat_ground_force(rig: Rig, wheel_centre_kN: Values | float, wheel_centre_mm: Values | float) -> Values:
    """Return the force as on flat ground, kN.

    Together with `flat_ground_displacement` this does not preserve work (the curvature factor goes into the force
    alone): take energies at the wheel centre, and call a flat-ground energy by that name.

    Parameters
    ----------
    rig:
        Radii and half spacing; the curvature factor is computed from them, not taken from its three printed digits.
    wheel_centre_kN:
        Force on the tyre at the wheel centre, the axle's load in it (`tyre_load`), kN, any shape.
    wheel_centre_mm:
        Displacement of the wheel centre since first touch, mm, of a shape that broadcasts with the force.

    Returns
    -------
    Force, kN, of the broadcast shape. Source: Eq. 8 and 9.
    """
    return _array(wheel_centre_kN) / (curvature_factor(rig) * sin_theta(rig, wheel_centre_mm))


def wheel_centre_start(rig: Rig, cylinder_load_kN: float, stiffness_kN_per_mm: float) -> float:
    """Return the displacement of the wheel centre (mm) at which the tyre rests under a cylinder load.

    On flat ground it is on the line F_f = k d_f; arguments and errors as in `flat_ground_start`.
    """
    lever = rig.axle.support_to_load_mm / rig.axle.support_to_wheel_centre_mm
    load = cylinder_load_kN * lever + rig.axle.axle_load_kN
    if not (stiffness_kN_per_mm > 0 and load >= 0):
        raise ValueError(f"needs k > 0 and a load on the tyre; got {stiffness_kN_per_mm} kN/mm and {load} kN")
    target = load / (stiffness_kN_per_mm * curvature_factor(rig))
    if rig.rollers is None:
        return target
    return _solve_displacement(target, centre_height_mm(rig), rig.rollers.half_spacing_mm)


def flat_ground_start(rig: Rig, cylinder_load_kN: float, stiffness_kN_per_mm: float) -> tuple[float, float]:
    """Return the flat-ground point at which the tyre rests under a cylinder load, on the line F_f = k d_f.

    Displacement and force are converted by Eq. 7 and Eq. 8 (or 9) at one and the same wheel-centre displacement. That
    pair does not preserve work: F_f d(d_f) is not F_wc d(d_wc), by the curvature factor (1.168 or 1.167) alone even
    where the angle hardly changes. The point is good for force against displacement, not for energies.

    Parameters
    ----------
    rig:
        Lever arms, axle load, radii and half spacing.
    cylinder_load_kN:
        Force of the hydraulic cylinder, kN; the axle's own load is added.
    stiffness_kN_per_mm:
        Slope k of the flat-ground line through the origin, kN/mm.

    Returns
    -------
    d_f (mm) and F_f (kN).

    Raises
    ------
    ValueError
        If k is not positive, the tyre would lift off, or no displacement carries the load.
    """
    d = wheel_centre_start(rig, cylinder_load_kN, stiffness_kN_per_mm)
    sine = 1.0
    if rig.rollers is not None:
        u = centre_height_mm(rig) - d
        sine = u / math.hypot(u, rig.rollers.half_spacing_mm)
    load = cylinder_load_kN * rig.axle.support_to_load_mm / rig.axle.support_to_wheel_centre_mm + rig.axle.axle_load_kN
    return d * sine, load / (curvature_factor(rig) * sine)


def _array(values: Values | float) -> Any:
    """Return JAX arrays as they are, all else as a numpy array of float64; Any, for it is the caller's kind."""
    return values if _is_jax(values) else np.asarray(values, float)


def _is_jax(values: Any) -> bool:
    """Return whether values are a JAX array: where nothing has imported JAX they are not, and it stays so."""
    return "jax" in sys.modules and isinstance(values, _jax().Array)


def _jax() -> Any:
    import jax

    return jax


def _solve_displacement(target_mm: float, height_mm: float, half_spacing_mm: float) -> float:
    # Newton for d sin^2(theta(d)) = target. The left side is concave where it rises, so that steps from d = 0
    # never pass the root: a step that finds no rise any more means that there is none.
    d = 0.0
    for _ in range(100):
        u = height_mm - d
        squared = u**2 / (u**2 + half_spacing_mm**2)
        rise = squared - d * 2 * u * half_spacing_mm**2 / (u**2 + half_spacing_mm**2) ** 2
        if u <= 0 or rise <= 0:
            break
        step = (target_mm - d * squared) / rise
        d += step
        if abs(step) <= 1e-13 * max(d, 1.0):
            return d
    raise ValueError(f"no displacement between the rollers carries this load ({target_mm:g} mm on flat ground)")
