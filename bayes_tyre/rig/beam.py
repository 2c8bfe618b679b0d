"""Weights and bending of the axle's beam: the formulas of appendices B2 and B3."""

import math
from typing import NamedTuple

from bayes_tyre.rig.axle import GRAVITY_M_PER_S2, Beam, Rig, needed


def second_moment_m4(beam: Beam) -> float:
    """Return the section's second moment of area (m^4), corners taken as square. Source: appendix B2."""
    outer = beam.outer_width_mm * beam.outer_height_mm**3
    inner = beam.inner_width_mm * beam.inner_height_mm**3
    return (outer - inner) / 12 * 1e-12


def section_area_m2(beam: Beam) -> float:
    """Return the section's area (m^2), corners rounded by the fillets. Source: appendix B2."""
    outer = beam.outer_width_mm * beam.outer_height_mm - (4 - math.pi) * beam.outer_fillet_mm**2
    inner = beam.inner_width_mm * beam.inner_height_mm - (4 - math.pi) * beam.inner_fillet_mm**2
    return (outer - inner) * 1e-6


def beam_of(rig: Rig) -> Beam:
    """Return the beam of a rig that describes one; BadInput names the key where it does not."""
    return needed(rig.beam, rig, "beam")


def beam_volume_m3(rig: Rig) -> float:
    """Return the volume (m^3) of a beam as long as the axle. Source: appendix B2."""
    return section_area_m2(beam_of(rig)) * rig.axle.support_to_wheel_centre_mm * 1e-3


def beam_weight_N(rig: Rig) -> float:
    """Return the beam's weight (N). Source: appendix B2."""
    return beam_volume_m3(rig) * beam_of(rig).density_kg_per_m3 * GRAVITY_M_PER_S2


def hub_weight_N(rig: Rig) -> float:
    """Return the weight (N) of the axle less its beam. Source: appendix B2."""
    return needed(rig.axle.mass_kg, rig, "axle.mass_kg") * GRAVITY_M_PER_S2 - beam_weight_N(rig)


def axle_load_on_tyre_kN(rig: Rig) -> float:
    """Return what the axle's weight puts on the tyre (kN): the hub and half of the beam. Source: appendix B2."""
    return (hub_weight_N(rig) + beam_weight_N(rig) / 2) * 1e-3


class _Bending(NamedTuple):
    """What deflection and slope at the measurement point are made of, a, b and x as in the source.

    Attributes
    ----------
    load_per_m2:
        The load over Young's modulus times the second moment of area, 1/m^2.
    a, span, x:
        The load from the support; a + b, the support from the wheel centre; the measurement point from the latter, m.
    constant_m2:
        The constant of the slope.
    """

    load_per_m2: float
    a: float
    span: float
    x: float
    constant_m2: float


def _bending(rig: Rig, load_kN: float, second_moment_m4: float) -> _Bending:
    length, load = rig.axle.support_to_wheel_centre_mm, rig.axle.support_to_load_mm
    a, b, x = load * 1e-3, (length - load) * 1e-3, (length - rig.axle.support_to_measurement_mm) * 1e-3
    stiffness = beam_of(rig).youngs_modulus_GPa * 1e9 * second_moment_m4
    constant = b**2 / 2 - b * (a + b) / 3 - b**3 / (6 * (a + b))
    return _Bending(load_kN * 1e3 / stiffness, a, a + b, x, constant)


def beam_deflection_m(rig: Rig, load_kN: float, second_moment_m4: float) -> float:
    """Return the beam's deflection at the measurement point, positive upward.

    Parameters
    ----------
    rig:
        Lever arms and Young's modulus; the beam rests freely on its support and on the wheel.
    load_kN:
        Cylinder load, kN.
    second_moment_m4:
        Second moment of area, m^4: given, not computed here, for the source goes on from its rounded value.

    Returns
    -------
    Deflection in m. Source: appendix B3, v_1, for a measurement point between load and wheel.
    """
    of = _bending(rig, load_kN, second_moment_m4)
    return of.load_per_m2 * (of.a * of.x**3 / (6 * of.span) + of.constant_m2 * of.x)


def beam_slope_rad(rig: Rig, load_kN: float, second_moment_m4: float) -> float:
    """Return the beam's slope (rad) at the measurement point; arguments as in `beam_deflection_m`. Source: B3."""
    of = _bending(rig, load_kN, second_moment_m4)
    return of.load_per_m2 * (of.a * of.x**2 / (2 * of.span) + of.constant_m2)
