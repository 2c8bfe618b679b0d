"""What the posterior says that records look like: residuals, and bands to hold against the points."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.diagnostics.residuals import OF_CURVE, Residuals, autocorrelations
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import law_of
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record_table import record_factors
from bayes_tyre.results.cases.draws import draw_noise
from bayes_tyre.results.equal_tailed import median_lower_upper
from bayes_tyre.results.prediction import force_kN
from bayes_tyre.results.summary import outlier_probability

SHOWN_RECORDS = 6
BAND_DRAWS = 1000


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
    tree: xr.DataTree, table: pd.DataFrame, records: list[str], interval: float = 0.95
) -> pd.DataFrame:
    """Return the posterior predictive of each point: `record, displacement_mm, median_kN, lower_kN, upper_kN`.

    Parameters
    ----------
    tree, table:
        The posterior, and the record table it was fitted to.
    records:
        Names of the records wanted.
    interval:
        Probability inside the band, noise of a new point included; the noise is the same each time.
    """
    rng = np.random.default_rng(0)
    batch = record_batch(table[table["record"].isin(records)])
    posterior = as_measured(with_records(tree)).sel(record=list(batch.records))
    nu = posterior["noise_nu"].to_numpy().reshape(-1, 1) if "noise_nu" in posterior else None
    bands = []
    for i, record in enumerate(batch.records):
        draws = {name: posterior[name].sel(record=record).to_numpy().reshape(-1, 1) for name in (*OF_CURVE, "sigma")}
        chosen = rng.integers(len(draws["k"]), size=BAND_DRAWS)
        d, present = batch.displacement_mm[i], batch.present[i]
        # With the padding, so that JAX compiles one length for all records.
        of_curve = {name: draws[name][chosen] for name in OF_CURVE}
        curves = force_kN(d - d[0], **of_curve, law=law_of(tree))[:, present]
        of_noise = None if nu is None else nu[chosen]
        new = curves + draws["sigma"][chosen] * draw_noise(rng, curves.shape, of_noise)
        median, lower, upper = median_lower_upper(new, interval)
        band = {"displacement_mm": d[present], "median_kN": median, "lower_kN": lower, "upper_kN": upper}
        bands.append(pd.DataFrame({"record": record, **band}))
    return pd.concat(bands, ignore_index=True)
