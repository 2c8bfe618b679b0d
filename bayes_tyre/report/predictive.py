"""What the posterior says that records look like: residuals, and bands to hold against the points."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.fit import record_batch
from bayes_tyre.record import Batch
from bayes_tyre.report.summary import outlier_probability

SHOWN_RECORDS = 6
BAND_DRAWS = 1000


def _force(u: np.ndarray, F_i: np.ndarray, J: np.ndarray, k: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Return Equation 2 (kN) at u (mm), in numpy; parameters broadcast in front of the points."""
    return F_i + (J + k * u) * -np.expm1(-np.abs(u) / beta)


def residual_autocorrelation(tree: xr.DataTree, table: pd.DataFrame) -> float:
    """Return the median over records of the lag-1 autocorrelation of residuals at the posterior mean."""
    batch = record_batch(table)
    mean = tree["posterior"].to_dataset()[["F_i", "J", "k", "beta"]].mean(("chain", "draw"))
    u = batch.displacement_mm - batch.displacement_mm[:, :1]
    curve = _force(u, *(mean[name].to_numpy()[:, None] for name in ("F_i", "J", "k", "beta")))
    residual = np.where(batch.present, batch.force_kN - curve, 0.0)
    residual -= np.where(batch.present, (residual.sum(axis=1) / batch.points)[:, None], 0.0)
    return float(np.median(np.sum(residual[:, 1:] * residual[:, :-1], axis=1) / np.sum(residual**2, axis=1)))


def records_to_show(tree: xr.DataTree) -> list[str]:
    """Return the names of a few records: one of each configuration and direction, and the most discordant."""
    posterior = tree["posterior"].to_dataset()
    names = posterior["record"].to_numpy().tolist()
    known = [f"record_{word}" for word in ("configuration", "direction") if f"record_{word}" in posterior.coords]
    cells = list(zip(*(posterior[word].to_numpy().tolist() for word in known), strict=True)) or [()] * len(names)
    chosen = [names[cells.index(cell)] for cell in dict.fromkeys(cells)][: SHOWN_RECORDS - 2]
    odd = outlier_probability(tree).dropna().sort_values(ascending=False).index
    return list(dict.fromkeys([*chosen, *(names[i] for i in odd[:2]), *names]))[: min(SHOWN_RECORDS, len(chosen) + 2)]


def predictive_bands(
    tree: xr.DataTree, table: pd.DataFrame, records: list[str], interval: float = 0.95, seed: int = 0
) -> pd.DataFrame:
    """Return the posterior predictive of each point: `record, displacement_mm, median_kN, lower_kN, upper_kN`.

    Parameters
    ----------
    tree, table:
        The posterior, and the record table it was fitted to.
    records:
        Names of the records wanted.
    interval:
        Probability inside the band, noise of a new point included.
    seed:
        Of the noise.
    """
    rng = np.random.default_rng(seed)
    posterior = tree["posterior"].to_dataset()
    batch: Batch = record_batch(table[table["record"].isin(records)])
    tails = [(1.0 - interval) / 2.0, 0.5, (1.0 + interval) / 2.0]
    bands = []
    for i, record in enumerate(batch.records):
        draws = {
            name: posterior[name].sel(record=record).to_numpy().reshape(-1, 1)
            for name in ("F_i", "J", "k", "beta", "sigma")
        }
        chosen = rng.integers(len(draws["k"]), size=BAND_DRAWS)
        d = batch.displacement_mm[i, batch.present[i]]
        curves = _force(d - d[0], *(draws[name][chosen] for name in ("F_i", "J", "k", "beta")))
        new = curves + draws["sigma"][chosen] * rng.standard_normal(curves.shape)
        lower, median, upper = np.quantile(new, tails, axis=0)
        band = {"displacement_mm": d, "median_kN": median, "lower_kN": lower, "upper_kN": upper}
        bands.append(pd.DataFrame({"record": record, **band}))
    return pd.concat(bands, ignore_index=True)
