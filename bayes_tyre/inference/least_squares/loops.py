"""Closed cycles of driven curves: energy by the loop's area and by the law of its branches, backbone, drift."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Float
from pandas.core.groupby import DataFrameGroupBy

from bayes_tyre.inference.least_squares.table import COLUMNS
from bayes_tyre.laws.fancher import equation_2
from bayes_tyre.laws.loop_energy import loop_energy

#: Points of a law's branch, closest where it begins; of a backbone.
LAW_POINTS, BACKBONE_POINTS = 400, 101
_CYCLE = ["loop", "cycle"]
_COLUMNS = (
    *("record", "cycle", "branches", "points", "energy_J", "law_energy_J", "energy_difference_J", "travel_mm"),
    *("closing_mm", "force_range_kN", "k_secant_kN_per_mm", "mean_force_kN", "energy_drift", "mean_force_drift_kN"),
    *("status", "origin"),
)


def cycle_table(branches: pd.DataFrame, fits: pd.DataFrame, backbones: pd.DataFrame) -> pd.DataFrame:
    """Return the closed cycles of driven curves, a row each.

    Parameters
    ----------
    branches:
        Points of the branches in measured order, as `bayes_tyre.signals.reversals.cut_loops` cuts them.
    fits:
        Their fits by `fit_records`.
    backbones:
        What `backbone` returns of the branches.

    Returns
    -------
    pandas.DataFrame
        `record`, `cycle`, `branches` (the numbers of its two), `points`; `energy_J`, the area of the polygon of its
        points, last joined to first; `law_energy_J`, that of Equation 2 as fitted to its branches, over the same travel
        (empty where one was not fitted); `energy_difference_J`, law less loop; `travel_mm`; `closing_mm`, how far the
        end lies from the start; `force_range_kN`; `k_secant_kN_per_mm`, between the points of least and greatest
        displacement; `mean_force_kN`, the mean of its backbone; against the first cycle of the record `energy_drift` (a
        part, no unit) and `mean_force_drift_kN`; `status`: ``ok`` or those of its branches; `origin`.
    """
    cycles = branches[branches["cycle"] > 0].groupby(_CYCLE, sort=False)
    if not len(cycles):
        return pd.DataFrame(columns=pd.Index(_COLUMNS))
    table = cycles["branch"].agg(lambda each: f"{each.iloc[0]}-{each.iloc[-1]}").reset_index(name="branches")
    table = table.rename(columns={"loop": "record"})
    table["points"] = cycles.size().to_numpy() - 1  # the point where it turns is in both branches
    in_cycle = fits["cycle"].to_numpy() > 0
    table = table.assign(**_areas_and_sizes(cycles, law_curves(branches, fits)[in_cycle]))
    table["mean_force_kN"] = backbones.groupby(["record", "cycle"], sort=False)["backbone_kN"].mean().to_numpy()
    first = table.groupby("record", sort=False)[["energy_J", "mean_force_kN"]].transform("first")
    table["energy_drift"] = table["energy_J"] / first["energy_J"] - 1.0
    table["mean_force_drift_kN"] = table["mean_force_kN"] - first["mean_force_kN"]
    of_cycles = fits[in_cycle].groupby(_CYCLE, sort=False)
    table["status"] = [_status(cycle) for _, cycle in of_cycles]
    table["origin"] = of_cycles["origin"].first().to_numpy()
    return table[list(_COLUMNS)]


def backbone(branches: pd.DataFrame) -> pd.DataFrame:
    """Return the backbone of each closed cycle: the mean of loading and unloading force at equal displacement.

    Parameters
    ----------
    branches:
        As in `cycle_table`.

    Returns
    -------
    `record`, `cycle`, `displacement_mm` (evenly over what both branches reach), `loading_kN`, `unloading_kN`
    (interpolated linearly) and `backbone_kN`.
    """
    curves = []
    for (loop, cycle), points in branches[branches["cycle"] > 0].groupby(_CYCLE, sort=False):
        paths = {str(name): path for name, path in points.groupby("direction")}
        least = max(path["displacement_mm"].min() for path in paths.values())
        most = min(path["displacement_mm"].max() for path in paths.values())
        d = np.linspace(least, most, BACKBONE_POINTS)
        forces = {f"{name}_kN": _force_at(d, paths[name]) for name in ("loading", "unloading")}
        mean = np.mean(list(forces.values()), axis=0)
        curves.append(
            pd.DataFrame({"record": loop, "cycle": cycle, "displacement_mm": d, **forces, "backbone_kN": mean})
        )
    columns = ["record", "cycle", "displacement_mm", "loading_kN", "unloading_kN", "backbone_kN"]
    return pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(columns=pd.Index(columns))


def law_curves(branches: pd.DataFrame, fits: pd.DataFrame) -> Float[np.ndarray, "branches points 2"]:
    """Return Equation 2 as fitted to each branch (mm, kN) from its first to its last point; NaN where not fitted."""
    by_branch = branches.groupby("record", sort=False)["displacement_mm"]
    first, last = (each.to_numpy(float)[:, None] for each in (by_branch.first(), by_branch.last()))
    d = first + (last - first) * np.linspace(0.0, 1.0, LAW_POINTS) ** 3
    values = {name: fits[column].to_numpy(float)[:, None] for name, column in COLUMNS.items()}
    return np.stack([d, np.asarray(equation_2(d, **values))], axis=2)


def _areas_and_sizes(cycles: DataFrameGroupBy, laws: Float[np.ndarray, "branches points 2"]) -> dict[str, np.ndarray]:
    d, F = (_padded([each.to_numpy(float) for _, each in cycles[name]]) for name in ("displacement_mm", "force_kN"))
    law_d, law_F = np.moveaxis(laws.reshape(len(d), -1, 2), 2, 0)  # the branches of a cycle follow each other
    paths = (d, F), (law_d, law_F)
    energy, law_energy = (np.asarray(jax.vmap(loop_energy)(*map(jnp.asarray, path))) for path in paths)
    rows, low, high = np.arange(len(d)), d.argmin(axis=1), d.argmax(axis=1)
    travel = np.ptp(d, axis=1)
    return {
        "energy_J": energy,
        "law_energy_J": law_energy,
        "energy_difference_J": law_energy - energy,
        "travel_mm": travel,
        "closing_mm": np.abs(d[:, -1] - d[:, 0]),
        "force_range_kN": np.ptp(F, axis=1),
        "k_secant_kN_per_mm": (F[rows, high] - F[rows, low]) / travel,
    }


def _padded(paths: list[np.ndarray]) -> Float[np.ndarray, "paths points"]:
    """Return paths as rows, their last value repeated, which adds no area."""
    widest = max(map(len, paths))
    return np.stack([np.pad(path, (0, widest - len(path)), mode="edge") for path in paths])


def _force_at(d: Float[np.ndarray, " points"], path: pd.DataFrame) -> Float[np.ndarray, " points"]:
    mean = path.groupby("displacement_mm")["force_kN"].mean()  # in ascending order, each displacement once
    return np.interp(d, mean.index.to_numpy(float), mean.to_numpy(float))


def _status(fits: pd.DataFrame) -> str:
    wrong = fits[fits["status"] != "ok"]
    return "; ".join(f"{row.direction}: {row.status}" for row in wrong.itertuples()) or "ok"
