"""Posteriors built by hand from chosen draws, without a sampler: what tables and verdicts are checked against."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.sampling.datatree import to_datatree
from bayes_tyre.record import CASE_FACTORS


def posterior(
    draws: Mapping[str, np.ndarray],
    factor_table: pd.DataFrame,
    statistics: Mapping[str, np.ndarray] | None = None,
    origin: str = "simulated",
) -> xr.DataTree:
    """Return draws, shape (chains, draws, ...), as the DataTree of a fit; without a `record`, of printed cases."""
    shape = next(iter(draws.values())).shape[:2]
    if "record" in factor_table:
        factors, records = (
            find_factors(factor_table),
            factor_table if "travel_mm" in factor_table else factor_table.assign(travel_mm=4.0),
        )
        model = "records"
    else:
        known = [word for word in CASE_FACTORS if word in factor_table]
        factors, records, model = find_factors(factor_table[known]), pd.DataFrame({"record": []}), "published"
    return to_datatree(
        draws, quiet(*shape) | dict(statistics or {}), factors, records, {"origin": origin, "model": model}
    )


def quiet(chains: int, draws: int) -> dict[str, np.ndarray]:
    """Return sampler statistics that nothing can be said against."""
    energy = np.random.default_rng(99).normal(size=(chains, draws))
    return {"diverging": np.zeros((chains, draws), dtype=bool), "energy": energy}


def fixed(values: object, chains: int = 2, draws: int = 8) -> np.ndarray:
    """Return draws that are the same every time, shape (chains, draws, len(values))."""
    one = np.asarray(values, dtype=float)
    return np.broadcast_to(one, (chains, draws, *one.shape)).copy()


def grid(configurations: tuple[str, ...] = ("single", "dual"), repeats: int = 3, **changed: tuple) -> pd.DataFrame:
    """Return the words of records, a row each: every configuration, 0 and 25 km/h, 20 to 30 kN and 30 to 20 kN."""
    steps = (("loading", 20.0, 10.0), ("unloading", 30.0, -10.0))
    rows = [
        (f"{c} {v:g} {d} {i}", c, d, v, load, step, i)
        for c in configurations
        for v in changed.get("speeds", (0.0, 25.0))
        for d, load, step in steps
        for i in range(1, repeats + 1)
    ]
    return pd.DataFrame(rows, columns=["record", *CASE_FACTORS, "repeat"])


def scattered(factor_table: pd.DataFrame, seed: int, chains: int = 4, draws: int = 250) -> dict[str, np.ndarray]:
    """Return well-mixed draws of what a fit keeps of records, their cases and populations."""
    rng = np.random.default_rng(seed)
    factors = find_factors(factor_table)

    def about(middle: np.ndarray | float, spread: float, *shape: int) -> np.ndarray:
        return middle * np.exp(spread * rng.normal(size=(chains, draws, *shape)))

    cases, records = len(factors.cases), len(factor_table)
    kept = {
        "k": about(np.linspace(1.2, 2.8, records), 0.02, records),
        "beta": about(np.geomspace(0.01, 0.1, records), 0.1, records),
        "J": about(0.4, 0.05, records),
        "C": about(-3.0, 0.05, records),
        "F_i": about(20.0, 0.001, records),
        "sigma": about(0.03, 0.05, records),
        "outlier_probability": rng.beta(1.0, 9.0, size=(chains, draws, records)),
        "k_case": about(np.linspace(1.4, 2.6, cases), 0.03, cases),
        "beta_case": about(np.geomspace(0.02, 0.08, cases), 0.1, cases),
        "k_group": about(1.8, 0.03, len(factors.group.labels)),
        "sd_log_k_case": about(0.05, 0.3),
        "sigma_typical": about(0.03, 0.1),
    }
    kept["beta_group"] = about(0.05, 0.1, len(factors.group.labels))
    kept |= {"sd_log_beta_case": about(0.2, 0.3), "sd_J": about(0.4, 0.2)}
    if factors.speed.varies:
        kept["log_k_speed"] = 0.05 * rng.normal(size=(chains, draws, len(factors.speed.labels)))
    return kept


#: k (kN/mm), x (kN), beta (mm) of `motion_cases`.
TYRE = {"k": 1.8, "x": 0.45, "beta": 0.08}


def motion_cases(amplitude_mm: float = 2.0) -> xr.DataTree:
    """Return a posterior of motions of two configurations, every draw the same, dual with twice the friction."""
    factor_table = [("single", "loading"), ("dual", "loading")]
    values = {name: [value, value * (2 if name == "x" else 1)] for name, value in TYRE.items()}
    draws = {
        f"{name}_case": (("chain", "draw", "case"), np.broadcast_to(of, (2, 5, 2)).copy())
        for name, of in {**values, "m": [280.0, 280.0]}.items()
    }
    labels = {"configuration": [one[0] for one in factor_table], "direction": [one[1] for one in factor_table]}
    numbers = {"speed_km_h": 0.0, "initial_load_kN": 20.0, "step_kN": 10.0}
    coords = {f"case_{word}": ("case", of) for word, of in labels.items()}
    coords |= {f"case_{word}": ("case", [of, of]) for word, of in numbers.items()}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(draws, coords)})
    tree.attrs |= {"origin": "simulated", "amplitude_mm": amplitude_mm, "law": "fancher"}
    return tree
