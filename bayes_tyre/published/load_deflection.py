"""Slow load-deflection tests reconstructed from the plan of Table 6 and the slopes of Table 10.

Each branch is a straight line through the origin, because only its slope is printed: no friction, no noise. Only k can
be estimated from it.
"""

import numpy as np
import pandas as pd

from bayes_tyre.published import tables
from bayes_tyre.published.tables import STIFFNESS
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.calibration import fit_line
from bayes_tyre.rig.load_deflection import deflection_of

_BRANCH = ["configuration", "direction", "speed_km_h"]


def reconstruct_tests() -> pd.DataFrame:
    """Return a load-deflection table whose lines have the printed slopes, as read at the rig.

    Returns
    -------
    `test`, `configuration`, `speed_km_h`, `direction`, `load_kN` of the cylinder, `displacement_mm` at the measurement
    point, `origin` (reconstructed), in measured order. Unloading at 0, 15, 25 and 35 km/h, loading at 0 km/h alone:
    what Table 10 has.
    """
    plan = tables.load_deflection_plan().set_index(["speed_km_h", "direction"])
    branches = []
    for row in tables.model_and_tests().query("kind == 'tests'").to_dict("records"):
        first, last, step = plan.loc[(row["speed_km_h"], row["direction"])]
        loads = np.arange(first, last + step / 2, step)
        rig = load_rig(row["configuration"])
        lever = float(geometry.wheel_centre_displacement(rig, 1.0))
        measured = [geometry.wheel_centre_start(rig, load, row[STIFFNESS]) / lever for load in loads]
        factors = {name: row[name] for name in _BRANCH}
        test = f"{row['configuration']} ({row['speed_km_h']:g})"
        branches.append(pd.DataFrame({"test": test, **factors, "load_kN": loads, "displacement_mm": measured}))
    return pd.concat(branches, ignore_index=True).assign(origin="reconstructed")


def returned_slopes() -> pd.DataFrame:
    """Return the slope of each reconstructed branch as on flat ground: the factors, `k_kN_per_mm` (kN/mm), 10 rows."""
    slopes = []
    for factors, branch in reconstruct_tests().groupby(_BRANCH, sort=False):
        load, mm = (branch[column].to_numpy(float) for column in ("load_kN", "displacement_mm"))
        tyre = deflection_of(load_rig(str(factors[0])), load, mm)
        line = fit_line(tyre.flat_ground_mm, tyre.flat_ground_kN)
        slopes.append({**dict(zip(_BRANCH, factors, strict=True)), STIFFNESS: line.slope})
    return pd.DataFrame(slopes)
