"""Readings of a slow load-deflection test, as the tyre has them: at the wheel centre, and as on flat ground."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

Readings = Float[np.ndarray, " readings"]


class Deflection(NamedTuple):
    """Displacement since first touch (mm) and force on the tyre (kN), its axle's load included; shape (readings,).

    Energies are taken at the wheel centre: the flat-ground pair does not preserve work (`geometry.flat_ground_force`).
    """

    wheel_centre_mm: Readings
    wheel_centre_kN: Readings
    flat_ground_mm: Readings
    flat_ground_kN: Readings


def deflection_of(rig: Rig, cylinder_kN: Readings, measured_mm: Readings) -> Deflection:
    """Return the load on the tyre and its deflection.

    Parameters
    ----------
    rig:
        Lever arms and axle load; radii and half spacing where there are rollers.
    cylinder_kN:
        Load of the cylinder, kN, shape (readings,); 0 is the axle's load alone.
    measured_mm:
        Displacement at the measurement point since the tyre first touched, mm, shape (readings,).

    Source: Eq. 3 to 10, section 2.4.1.
    """
    mm = np.asarray(geometry.wheel_centre_displacement(rig, measured_mm), float)
    kN = np.asarray(geometry.tyre_load(rig, cylinder_kN), float)
    flat_mm, flat_kN = geometry.flat_ground_displacement(rig, mm), geometry.flat_ground_force(rig, kN, mm)
    return Deflection(mm, kN, np.asarray(flat_mm, float), np.asarray(flat_kN, float))
