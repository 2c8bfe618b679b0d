"""What natural frequencies say of a flexible ring, as tables: its parameters, and each frequency beside its fit."""

import numpy as np
import pandas as pd

from bayes_tyre.inference.flexible_ring import PARAMETERS, MeasuredModes, RingFit
from bayes_tyre.results.equal_tailed import median_lower_upper
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: What `modes.csv` calls a parameter: from frequencies alone; and of a belt whose mass and radius are given, with its
#: unit.
_PER_MASS = {"bending": "EI/(rho A R^4)", "tension": "T/(rho A R^2)", "radial": "k_w/(rho A)"}
_PER_MASS |= {"tangential": "k_v/(rho A)", "sigma": "sigma"}
_OF_BELT = {"bending": ("EI", "kN mm^2"), "tension": ("T", "kN"), "radial": ("k_w", "kN/mm^2")}
_OF_BELT |= {"tangential": ("k_v", "kN/mm^2")}


def ring_parameters(
    modes: MeasuredModes,
    fit: RingFit,
    interval: float = 0.95,
    *,
    radius_mm: float | None = None,
    mass_kg_per_m: float | None = None,
) -> pd.DataFrame:
    """Return `modes.csv`: `parameter, unit, median, lower, upper, interval, status`, a row a parameter.

    Frequencies determine stiffnesses per mass and length of the belt (1/s^2); with its radius, mm, and mass per length,
    kg/m, the table has the stiffnesses themselves. Where pressures are given, tension is that of each bar.
    """
    units = {name: prior.unit for name, prior in modes.priors.items()}
    rows = []
    for name, draws in fit.draws.items():
        label, unit, scale = _PER_MASS[name], units[name], 1.0
        if radius_mm is not None and mass_kg_per_m is not None and name in _OF_BELT:
            power = {"bending": 4, "tension": 2}.get(name, 0)
            scale = mass_kg_per_m / 1000.0 * radius_mm**power * KN_PER_KG_MM_PER_S2
            label, unit = _OF_BELT[name][0], _OF_BELT[name][1] + ("/bar" if unit.endswith("/bar") else "")
        label += "/p" if unit.endswith("/bar") else ""
        median, lower, upper = scale * median_lower_upper(draws, interval)
        row = {"parameter": label, "unit": unit, "median": median, "lower": lower, "upper": upper}
        sums = "" if fit.status[name] == "ok" or name not in _OF_BELT else _sums(modes, fit)
        rows.append({**row, "interval": interval, "status": fit.status[name] + sums})
    return pd.DataFrame(rows)


def ring_frequencies(modes: MeasuredModes, fit: RingFit, interval: float = 0.95) -> pd.DataFrame:
    """Return of each measured frequency `fitted_Hz`, `lower`, `upper` and `interval` of the fit, and `residual_Hz`."""
    fitted, lower, upper = median_lower_upper(fit.frequencies, interval)
    bounds = {"fitted_Hz": fitted, "lower": lower, "upper": upper, "interval": interval}
    return pd.DataFrame({**bounds, "residual_Hz": modes.frequency_Hz - fitted})


def parameter_lines(parameters: pd.DataFrame) -> list[str]:
    """Return a line a row of `modes.csv`: median, interval, unit, and what is not identified."""
    lines = []
    for row in parameters.fillna({"unit": ""}).itertuples():
        text = f"{row.parameter} {row.median:.4g} [{row.lower:.4g}, {row.upper:.4g}] {row.unit}"
        status = str(row.status).partition(";")[0]
        lines.append(text if status == "ok" else f"{text}: {status}")
    return lines


def _sums(modes: MeasuredModes, fit: RingFit) -> str:
    """Return which sums of the stiffnesses are all that the modes give; empty where they give each by itself."""
    if fit.rank == len(PARAMETERS):
        return ""
    sums = []
    for mode in np.unique(modes.mode):
        square = mode**2
        terms = {"EI/R^4": square * (square - 1) ** 2, "T/R^2": square * (square - 1), "k_w": square, "k_v": 1.0}
        text = " + ".join(name if times == 1 else f"{times:g} {name}" for name, times in terms.items() if times)
        sums.append(f"{text} (mode {mode:g})")
    return f"; the modes give only {', '.join(sums)}, over rho A"
