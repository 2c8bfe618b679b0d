"""The branches of loops: of the two measured ones in `data/measured`, and of made ones that follow other laws."""

from itertools import pairwise

import numpy as np
import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.record_table import check_record_table

#: Part of the way by which a displacement turns back at a reversal, and not by noise.
_TURN = 0.1


def measured_branches(name: str) -> list[pd.DataFrame]:
    """Return the branches between the reversals of a measured loop."""
    loop = pd.read_csv(data_path(f"measured/{name}.csv"))[["displacement_mm", "force_kN"]]
    d = loop["displacement_mm"].to_numpy()
    ends = [0, *_reversals(d, _TURN * np.ptp(d)), len(d) - 1]
    return [loop.iloc[first : last + 1].reset_index(drop=True) for first, last in pairwise(ends)]


def _reversals(d: np.ndarray, turn: float) -> list[int]:
    found, far, way = [], 0, 0.0
    for i in range(len(d)):
        if way == 0.0 and abs(d[i] - d[0]) > turn:
            way = np.sign(d[i] - d[0])
        if way * (d[i] - d[far]) >= 0:
            far = i
        elif abs(d[i] - d[far]) > turn:
            found.append(far)
            far, way = i, -way
    return found


def made_branch(law: str, noise: float, points: int, seed: int) -> pd.DataFrame:
    """Return a branch of 3 mm: ``bilinear``, ``viscous`` or ``equation_2``; noise as a part of the change of force."""
    u = 1.5 * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, points)))
    if law == "bilinear":
        force = np.where(u < 0.6, 8.0 * u, 4.8 + 1.0 * (u - 0.6))
    elif law == "viscous":
        force = 1.6 * u + 2.0 * np.sin(np.pi * np.linspace(0.0, 1.0, points))
    else:
        force = (0.4 + 1.6 * u) * -np.expm1(-u / 0.1)
    error = noise * np.ptp(force) * np.random.default_rng(seed).normal(size=points)
    return pd.DataFrame({"displacement_mm": 10.0 + u, "force_kN": 14.0 + force + error})


def as_table(branches: dict[str, pd.DataFrame], every: int = 1) -> pd.DataFrame:
    """Return branches as a checked record table, every n-th point of each."""
    return check_record_table(pd.concat([b.iloc[::every].assign(record=name) for name, b in branches.items()]))
