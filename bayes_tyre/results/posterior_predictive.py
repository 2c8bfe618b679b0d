"""What the posterior says that records look like: residuals, and bands to hold against the points."""

from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import whiten
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.record_table import record_factors
from bayes_tyre.results.prediction import force_kN
from bayes_tyre.results.summary import outlier_probability

SHOWN_RECORDS = 6
BAND_DRAWS = 1000
_OF_CURVE = ("F_i", "J", "k", "beta")


class Residuals(NamedTuple):
    """What the records are off Equation 2 at the posterior means of its parameters.

    Attributes
    ----------
    batch:
        The records.
    residual_kN, white_kN:
        Shape (records, points), measured less curve; 0 on padding. White: less the correlation from point to point
        that the model gives the noise; the same where it gives none.
    sigma_kN:
        Shape (records,): the posterior mean of the noise.
    """

    batch: Batch
    residual_kN: Float[np.ndarray, "records points"]
    white_kN: Float[np.ndarray, "records points"]
    sigma_kN: Float[np.ndarray, " records"]


def _as_measured(posterior: xr.Dataset, records: list[str]) -> xr.Dataset:
    """Return F_i, J, k, beta and sigma of the records for displacement as it was measured.

    A posterior's k and beta are of the true displacement, `displacement_scale` times the measured one where it has
    such a factor: at a measured u, Eq. 2 is that of k times and beta over the factor.
    """
    parameters = posterior[[name for name in (*_OF_CURVE, "sigma", "rho") if name in posterior]].sel(record=records)
    if "displacement_scale" not in posterior:
        return parameters
    factor = posterior["displacement_scale"]
    return parameters.assign(k=parameters["k"] * factor, beta=parameters["beta"] / factor)


def residuals(tree: xr.DataTree, table: pd.DataFrame) -> Residuals:
    """Return the residuals (kN) of every record of a table at the posterior mean."""
    batch = record_batch(table)
    mean = _as_measured(tree["posterior"].to_dataset(), list(batch.records)).mean(("chain", "draw"))
    u = batch.displacement_mm - batch.displacement_mm[:, :1]
    curve = force_kN(u, *(mean[name].to_numpy()[:, None] for name in _OF_CURVE))
    residual = np.where(batch.present, batch.force_kN - curve, 0.0)
    rho = mean["rho"].to_numpy() if "rho" in mean else None
    white = whiten(residual, batch.present, rho, int(tree.attrs.get("noise_window", 1)))
    return Residuals(batch, residual, white, mean["sigma"].to_numpy())


def autocorrelations(of_records: Residuals) -> Float[np.ndarray, " records"]:
    """Return the lag-1 autocorrelation of each record's residuals, about their mean: of what the model calls white."""
    batch, residual = of_records.batch, of_records.white_kN
    centred = residual - np.where(batch.present, (residual.sum(axis=1) / batch.points)[:, None], 0.0)
    return np.sum(centred[:, 1:] * centred[:, :-1], axis=1) / np.sum(centred**2, axis=1)


def residual_tables(
    of_records: Residuals, table: pd.DataFrame, records: list[str]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the residuals of the records named, a row a point, and what they come to in every record, a row each.

    Columns `record, displacement_mm, residual_kN`; and `record, configuration` (where the table has it), `sigma_kN`,
    `autocorrelation`.
    """
    batch = of_records.batch
    shown = np.isin(batch.records, records)[:, None] & batch.present
    points = pd.DataFrame(
        {
            "record": np.asarray(batch.records, dtype=object)[np.nonzero(shown)[0]],
            "displacement_mm": batch.displacement_mm[shown],
            "residual_kN": of_records.residual_kN[shown],
        }
    )
    figures = {"sigma_kN": of_records.sigma_kN, "autocorrelation": autocorrelations(of_records)}
    return points, record_factors(table).assign(**figures)


def residual_autocorrelation(tree: xr.DataTree, table: pd.DataFrame) -> float:
    """Return the median over records of the lag-1 autocorrelation of residuals at the posterior mean."""
    return float(np.median(autocorrelations(residuals(tree, table))))


def records_to_show(tree: xr.DataTree) -> list[str]:
    """Return the names of a few records: one of each configuration and direction, and the most discordant.

    Where there are too many, configurations come before directions.
    """
    posterior = tree["posterior"].to_dataset()
    names = posterior["record"].to_numpy().tolist()
    coordinates = [
        f"record_{factor}" for factor in ("configuration", "direction") if f"record_{factor}" in posterior.coords
    ]
    groups = list(zip(*(posterior[factor].to_numpy().tolist() for factor in coordinates), strict=True)) or [()] * len(
        names
    )
    different = list(dict.fromkeys(groups))
    before = [sum(group[:1] == other[:1] for other in different[:i]) for i, group in enumerate(different)]
    ordered = [group for _, group in sorted(zip(before, different, strict=True), key=lambda pair: pair[0])]
    chosen = [names[groups.index(group)] for group in ordered][: SHOWN_RECORDS - 2]
    discordant = outlier_probability(tree).dropna().sort_values(ascending=False).index
    return list(dict.fromkeys([*chosen, *(names[i] for i in discordant[:2]), *names]))[
        : min(SHOWN_RECORDS, len(chosen) + 2)
    ]


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
    batch = record_batch(table[table["record"].isin(records)])
    posterior = _as_measured(tree["posterior"].to_dataset(), list(batch.records))
    tails = [(1.0 - interval) / 2.0, 0.5, (1.0 + interval) / 2.0]
    bands = []
    for i, record in enumerate(batch.records):
        draws = {name: posterior[name].sel(record=record).to_numpy().reshape(-1, 1) for name in (*_OF_CURVE, "sigma")}
        chosen = rng.integers(len(draws["k"]), size=BAND_DRAWS)
        d, present = batch.displacement_mm[i], batch.present[i]
        # With the padding, so that JAX compiles one length for all records.
        curves = force_kN(d - d[0], *(draws[name][chosen] for name in _OF_CURVE))[:, present]
        new = curves + draws["sigma"][chosen] * rng.standard_normal(curves.shape)
        lower, median, upper = np.quantile(new, tails, axis=0)
        band = {"displacement_mm": d[present], "median_kN": median, "lower_kN": lower, "upper_kN": upper}
        bands.append(pd.DataFrame({"record": record, **band}))
    return pd.concat(bands, ignore_index=True)
