"""From the wheel centre (between two rollers, say) to flat ground; no sensor knows how far the tyre is pressed in."""

from typing import NamedTuple

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Samples
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

# The start enters through an angle that changes by 0.03 % a mm: each round takes the error down some thousandfold.
_ROUNDS = 4
# The line is taken past so much of the travel, where the friction has turned.
_LINE_FROM = 0.3


class OnFlatGround(NamedTuple):
    """A path on flat ground: mm and kN, and kN there for 1 kN at the wheel centre; shape (samples,)."""

    displacement_mm: Samples
    force_kN: Samples
    per_wheel_centre: Samples
    start_mm: float


def to_flat_ground(rig: Rig, moved_mm: Samples, force_kN: Samples, cylinder_kN: float) -> OnFlatGround:
    """Return a path of the wheel centre as on flat ground (Eq. 7 to 10), from the displacement since it was at rest.

    The geometry needs the displacement since first touch. It is found so that record and static load agree: a tyre on
    a line through the origin, as stiff as the record's own path, rests under the load before the step at that
    displacement (`geometry.wheel_centre_start`). An offset C of the true line shifts d by C / k and, where there are
    rollers, changes k by some 0.03 % a mm.

    Parameters
    ----------
    rig:
        Lever arms and axle load; radii and half spacing where there are rollers.
    moved_mm, force_kN:
        Displacement from rest, mm, and force on the tyre, kN, at the wheel centre, shape (samples,).
    cylinder_kN:
        Load of the cylinder at rest, before the step.

    Raises
    ------
    BadInput
        If force falls as displacement grows, or no displacement carries the load.
    """
    k = _slope(moved_mm, force_kN) / geometry.curvature_factor(rig)
    for _ in range(_ROUNDS):
        try:
            start = geometry.wheel_centre_start(rig, cylinder_kN, k)
        except ValueError as error:
            raise BadInput(f"path has no start under load: {error}; check signs and lever arms of the rig") from None
        d = start + moved_mm
        per_wheel_centre = np.asarray(geometry.flat_ground_force(rig, np.ones_like(d), d), float)
        flat = np.asarray(geometry.flat_ground_displacement(rig, d), float)
        k = _slope(flat, force_kN * per_wheel_centre)
    return OnFlatGround(flat, force_kN * per_wheel_centre, per_wheel_centre, start)


def _slope(d: Samples, force: Samples) -> float:
    travel = d - d[0]
    late = np.abs(travel) >= _LINE_FROM * np.abs(travel).max()
    away = d[late] - d[late].mean()
    squared = float(away @ away)
    return float(away @ force[late]) / squared if squared > 0 else float("nan")
