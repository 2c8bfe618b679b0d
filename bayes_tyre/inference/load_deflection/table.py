"""Slow load-deflection tests: a row a test with two straight lines, Fancher's law, energies and a status."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy import stats

from bayes_tyre.inference.load_deflection.cycle_fit import Cycle, CycleEstimate, estimate_cycles
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.loop_energy import loop_energy

LINES = ("loading", "unloading")
#: Where a test's readings are: the columns of displacement (mm) and force (kN).
FLAT_GROUND = ("flat_ground_mm", "flat_ground_kN")
WHEEL_CENTRE = ("wheel_centre_mm", "wheel_centre_kN")
#: Grid of betas: their number, and the least over the spacing of the readings (no reading depends on it); the largest
#: is the stroke.
_BETAS, _LEAST = 300, 1e-3
#: Readings are padded to a multiple of the width; tests are fitted in blocks of this size.
_WIDTH, _BLOCK = 32, 4
#: Fewest readings of a test that leave a degree of freedom beside a curvature.
_FEWEST = 5
#: Significance level of a curvature of the envelopes.
_CURVATURE_LEVEL = 1e-3
_LAW = ("k_kN_per_mm", "C_kN", "x_less_k_beta_kN", "beta_mm")


class Line(NamedTuple):
    """A straight line through readings: slope (kN/mm) and force at zero displacement (kN), with standard errors (NaN
    for two readings), root mean square of the residuals (kN), and number of readings."""

    k: float = np.nan
    k_se: float = np.nan
    C: float = np.nan
    C_se: float = np.nan
    rmse: float = np.nan
    readings: int = 0


def straight_line(d: Float[np.ndarray, " n"], F: Float[np.ndarray, " n"]) -> Line:
    """Return the least-squares line of force, kN, over displacement, mm; NaN without two different displacements.

    Standard errors from RSS / (readings - 2). Source: section 2.5, as for its averaged load-deflection tests.
    """
    n = len(d)
    if n < 2 or np.ptp(d) == 0:
        return Line(readings=n)
    centre = d.mean()
    squared = float(((d - centre) ** 2).sum())
    k = float((d - centre) @ (F - F.mean())) / squared
    residual = F - F.mean() - k * (d - centre)
    variance = float(residual @ residual) / (n - 2) if n > 2 else np.nan
    C_se = np.sqrt(variance * (1 / n + centre**2 / squared))
    rmse = float(np.sqrt(residual @ residual / n))
    return Line(k, float(np.sqrt(variance / squared)), float(F.mean() - k * centre), float(C_se), rmse, n)


def fit_tests(table: pd.DataFrame, beta_mm: float | None = None) -> pd.DataFrame:
    """Return lines, law and energies of every test, a row each, in the order of the table.

    Parameters
    ----------
    table:
        A row a reading, in measured order: `test`, `direction`, `on_loading_line`, `on_unloading_line`, and
        displacement (mm) and force (kN) as on flat ground and at the wheel centre (`FLAT_GROUND`, `WHEEL_CENTRE`).
    beta_mm:
        beta, mm, where it is known; None: it is fitted.

    Returns
    -------
    pandas.DataFrame
        `test`; of the two lines `k_loading_kN_per_mm`, `C_loading_kN`, `rmse_loading_kN`, `readings_loading`, and
        likewise unloading; of the law `k_kN_per_mm`, `C_kN`, `x_less_k_beta_kN` (half the distance between the settled
        branches), `x_kN`, `beta_mm`, each with its standard error (`_se`), and the limits within 95 % by the profile
        over beta (`x_low_kN`, `x_high_kN`, `beta_high_mm`), `rmse_kN`: all as on flat ground. At the wheel centre
        `energy_per_cycle_J` by the law over `stroke_mm`, and `loop_area_J` of the polygon of the readings; the same as
        on flat ground, which is no work done, `flat_ground_energy_per_cycle_J` and `flat_ground_loop_area_J`; the ends
        of the displacement there, `flat_ground_low_mm` and `flat_ground_high_mm`. `status` is ``ok`` or why the
        estimates are not reliable. Empty where not determined.
    """
    tests = [test for _, test in table.groupby("test", sort=False)]
    flat, centre = (_law(tests, place, beta_mm) for place in (FLAT_GROUND, WHEEL_CENTRE))
    rows = []
    for i, test in enumerate(tests):
        lines = {name: _line(test, name) for name in LINES}
        row = {"test": test["test"].iloc[0], **_line_columns(lines)}
        row |= _law_columns(flat.get(i), len(test)) | _energy_columns(test, flat.get(i), centre.get(i))
        rows.append({**row, "readings": len(test), "status": _status(test, lines, flat.get(i), beta_mm)})
    return pd.DataFrame(rows)


def law_loop(row: Mapping[str, Any], low_mm: float, high_mm: float, points: int = 400) -> Float[np.ndarray, "n 2"]:
    """Return the law's closed loop between two displacements, mm, in the steady state: mm and kN, shape (n, 2).

    Where beta is not determined, with a beta far below the spacing of the readings.
    """
    k, C = float(row["k_kN_per_mm"]), float(row["C_kN"])
    beta = float(row["beta_mm"]) if row["beta_mm"] == row["beta_mm"] else 1e-6 * (high_mm - low_mm)
    law = Fancher(k=k, C=C, x=float(row["x_less_k_beta_kN"]) + k * beta, beta=beta)
    # Dense near the reversals, where the force changes fast.
    away = (high_mm - low_mm) * np.linspace(0.0, 1.0, points // 2) ** 3
    up, down = low_mm + away, high_mm - away
    path = np.concatenate([up, down])
    F = law.force(jnp.asarray(np.concatenate([path, path])), k * low_mm + C)
    return np.stack([path, np.asarray(F)[len(path) :]], axis=1)


def _line(test: pd.DataFrame, name: str) -> Line:
    rows = test[test[f"on_{name}_line"]]
    d, F = (rows[column].to_numpy(float) for column in FLAT_GROUND)
    return straight_line(d, F)


def _line_columns(lines: Mapping[str, Line]) -> dict[str, float]:
    columns: dict[str, float] = {}
    for name, line in lines.items():
        columns |= {f"k_{name}_kN_per_mm": line.k, f"k_{name}_kN_per_mm_se": line.k_se}
        columns |= {f"C_{name}_kN": line.C, f"C_{name}_kN_se": line.C_se}
        columns |= {f"rmse_{name}_kN": line.rmse, f"readings_{name}": line.readings}
    return columns


def _unfittable(test: pd.DataFrame, beta_mm: float | None) -> str:
    """Return why the law cannot be fitted to a test; empty where it can."""
    there = set(test["direction"])
    if len(there) == 1:
        return f"only {there.pop()} readings: friction shows between loading and unloading alone"
    parameters = 4 if beta_mm is None else 3
    if len(test) <= parameters:
        return f"too few readings: {len(test)} for {parameters} parameters"
    if any(np.ptp(test[column].to_numpy(float)) == 0 for column in (*FLAT_GROUND, *WHEEL_CENTRE)):
        return "no travel: displacement or force is constant"
    return ""


def _law(tests: list[pd.DataFrame], place: tuple[str, str], beta_mm: float | None) -> dict[int, CycleEstimate]:
    """Return the estimate of the law for each test that has one."""
    fittable = [i for i, test in enumerate(tests) if not _unfittable(test, beta_mm)]
    if not fittable:
        return {}
    # In blocks of one size with readings padded, because each shape is compiled.
    widest = -(-max(len(tests[i]) for i in fittable) // _WIDTH) * _WIDTH
    estimates: dict[int, CycleEstimate] = {}
    for first in range(0, len(fittable), _BLOCK):
        block = fittable[first : first + _BLOCK]
        padded = [*block, *([block[-1]] * (_BLOCK - len(block)))]
        cycles = [_cycle(tests[i], place, widest, beta_mm) for i in padded]
        batch = Cycle(*(jnp.asarray(np.stack(field)) for field in zip(*cycles, strict=True)))
        fitted = jax.device_get(estimate_cycles(batch))
        estimates |= {i: CycleEstimate(*(field[j] for field in fitted)) for j, i in enumerate(block)}
    return estimates


def _cycle(test: pd.DataFrame, place: tuple[str, str], width: int, beta_mm: float | None) -> tuple[np.ndarray, ...]:
    """Return the fields of a `Cycle`, padded to a width."""
    d, F = (test[column].to_numpy(float) for column in place)
    n = len(d)
    moves = np.abs(np.diff(d))
    spacing = float(np.median(moves[moves > 0]))
    betas = np.geomspace(_LEAST * spacing, np.ptp(d), _BETAS) if beta_mm is None else np.full(_BETAS, beta_mm)
    start = 1.0 if test["direction"].iloc[0] == "loading" else -1.0
    spare = n - (4 if beta_mm is None else 3)
    rise, refuted = (np.asarray(point) for point in stats.f.ppf((0.95, 0.999), 1, spare))
    padded = [np.pad(values, (0, width - n), mode="edge") for values in (d, F)]
    return (*padded, np.arange(width) < n, np.asarray(start), betas, rise, refuted)


def _law_columns(estimate: CycleEstimate | None, readings: int) -> dict[str, float]:
    names = [name for column in (*_LAW, "x_kN") for name in (column, f"{column}_se")]
    if estimate is None or not estimate.converged:
        return dict.fromkeys([*names, "x_low_kN", "x_high_kN", "beta_high_mm", "rmse_kN"], np.nan)
    values, errors = np.append(estimate.value, estimate.x), np.append(estimate.standard_error, estimate.x_se)
    columns = dict(zip(names, np.stack([values, errors], axis=1).ravel().tolist(), strict=True))
    if not np.isfinite(columns["x_kN_se"]):  # the value is an end of the grid of betas
        columns |= {"x_kN": np.nan, "beta_mm": np.nan}
    high = float(estimate.beta_range[1])
    bounded = np.isfinite(high)
    columns |= {"x_low_kN": float(estimate.x_range[0]), "x_high_kN": float(estimate.x_range[1]) if bounded else np.nan}
    columns["beta_high_mm"] = high if bounded else np.nan
    return columns | {"rmse_kN": float(np.sqrt(estimate.rss / readings))}


def _energy_columns(test: pd.DataFrame, flat: CycleEstimate | None, centre: CycleEstimate | None) -> dict[str, float]:
    columns: dict[str, float] = {}
    closed = set(test["direction"]) == set(LINES)
    for prefix, place, estimate in (("", WHEEL_CENTRE, centre), ("flat_ground_", FLAT_GROUND, flat)):
        d, F = (test[column].to_numpy(float) for column in place)
        fitted = estimate if estimate is not None and estimate.converged else None
        columns[f"{prefix}energy_per_cycle_J"] = np.nan if fitted is None else float(fitted.energy)
        columns[f"{prefix}energy_per_cycle_J_se"] = np.nan if fitted is None else float(fitted.energy_se)
        columns[f"{prefix}loop_area_J"] = float(loop_energy(jnp.asarray(d), jnp.asarray(F))) if closed else np.nan
    travel = test[FLAT_GROUND[0]]
    ends = {"flat_ground_low_mm": float(travel.min()), "flat_ground_high_mm": float(travel.max())}
    return {"stroke_mm": float(np.ptp(test[WHEEL_CENTRE[0]])), **columns, **ends}


def _status(
    test: pd.DataFrame, lines: Mapping[str, Line], estimate: CycleEstimate | None, beta_mm: float | None
) -> str:
    reasons = [_unfittable(test, beta_mm)]
    for name in LINES:
        if test["direction"].eq(name).any() and np.isnan(lines[name].k):
            reasons.append(f"fewer than 2 {name} readings at different displacements: no line")
    if any(line.k <= 0 for line in lines.values()):
        reasons.append("force falls as displacement grows: check the signs")
    if estimate is not None and not estimate.converged:
        reasons.append("did not converge: check the readings")
    elif estimate is not None:
        reasons += _law_reasons(test, estimate, beta_mm)
        reasons += [_curvature(test, estimate)]
    return "; ".join(reason for reason in reasons if reason) or "ok"


def _law_reasons(test: pd.DataFrame, estimate: CycleEstimate, beta_mm: float | None) -> list[str]:
    half_stroke = np.ptp(test[FLAT_GROUND[0]].to_numpy(float)) / 2
    if beta_mm is not None and beta_mm > half_stroke:
        return [f"beta of {beta_mm:.3g} mm is above half the stroke, {half_stroke:.3g} mm: friction and k trade"]
    if not estimate.value[2] > 0:
        return ["no friction seen: unloading readings do not lie below loading ones, x - k beta is at its bound 0"]
    if beta_mm is not None:
        return []
    below, above = bool(estimate.open_below), bool(estimate.open_above)
    d = test[FLAT_GROUND[0]].to_numpy(float)
    apart = f"readings stand {np.median(np.abs(np.diff(d))):.2g} mm apart"
    if below and above:
        return [f"beta not determined: this test bounds it neither below nor above; {apart}, x is x_low_kN or more"]
    if below:
        between = "k, C and x - k beta are those of a small beta, x lies between x_low_kN and x_high_kN"
        return [f"beta not determined: only an upper bound, beta_high_mm; {apart}; {between}"]
    if above:
        return ["beta not determined: only a lower bound, beyond the stroke it trades against friction"]
    return []


def _curvature(test: pd.DataFrame, estimate: CycleEstimate) -> str:
    """Return that the envelopes are curved, where a quadratic term is significant; empty where it is not."""
    d, F = (test[column].to_numpy(float) for column in FLAT_GROUND)
    if len(d) <= _FEWEST:
        return ""
    beta = estimate.value[3]
    start = 1.0 if test["direction"].iloc[0] == "loading" else -1.0
    shape = np.asarray(Fancher(k=0.0, C=0.0, x=1.0, beta=beta).force(jnp.asarray(d), start))
    u = (d - d.mean()) / np.ptp(d)
    columns = np.stack([np.ones_like(u), u, shape, u**2], axis=1)
    values, *_ = np.linalg.lstsq(columns, F, rcond=None)
    residual = F - columns @ values
    spare = len(d) - 5
    covariance = np.linalg.pinv(columns.T @ columns)
    rounding = 1e-12 * np.ptp(F)
    t = values[3] / np.sqrt(covariance[3, 3] * max(float(residual @ residual) / spare, rounding**2))
    if abs(t) < stats.t.ppf(1 - _CURVATURE_LEVEL / 2, spare) or abs(values[3]) < 1e-9 * np.ptp(F):
        return ""
    growth = 2 * values[3] / np.ptp(d)
    return (
        f"the envelopes bend: k grows by {growth:.2g} kN/mm from one end of the stroke to the other (t = {t:.1f}); "
        "k, x and the energy are those of straight ones"
    )
