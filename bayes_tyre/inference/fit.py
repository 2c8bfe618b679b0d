"""From a table to a posterior: the two hierarchical fits, put together from their parts."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.coordinates import RecordEstimates, estimate_records, record_data
from bayes_tyre.inference.hierarchical import published_model, records_model
from bayes_tyre.inference.levels import Levels, find_levels
from bayes_tyre.inference.posterior import to_datatree
from bayes_tyre.inference.sampling import SamplerSettings, sample
from bayes_tyre.record import CASE_WORDS, Batch, origin_of, pad, record_words

#: F_i, J, k, beta and sigma of a record, and one point to spare.
LEAST_POINTS = 6


def record_batch(table: pd.DataFrame) -> Batch:
    """Return every record of a checked table as one batch.

    Raises
    ------
    BadInput
        For a record with too few points or no travel: a hierarchical fit drops no record.
    """
    names, displacement, force = [], [], []
    for name, rows in table.groupby("record", sort=False):
        names.append(str(name))
        displacement.append(rows["displacement_mm"].to_numpy(dtype=float))
        force.append(rows["force_kN"].to_numpy(dtype=float))
        if len(rows) < LEAST_POINTS:
            raise BadInput(f"record {name!r}: {len(rows)} points, a fit needs {LEAST_POINTS}; remove the record")
        if np.ptp(displacement[-1]) == 0 or np.ptp(force[-1]) == 0:
            still = "displacement_mm" if np.ptp(displacement[-1]) == 0 else "force_kN"
            raise BadInput(f"record {name!r}: {still} is constant, nothing to fit; remove the record")
    return pad(tuple(names), displacement, force)


def fit_hierarchical(table: pd.DataFrame, settings: SamplerSettings | None = None) -> xr.DataTree:
    """Return the posterior of k, beta, J, C and sigma of every record, their cases and populations.

    Parameters
    ----------
    table:
        A checked record table (`bayes_tyre.record.check_record_table`).
    settings:
        How much to sample.

    Returns
    -------
    xarray.DataTree
        Groups `posterior`, `sample_stats`, `posterior_predictive_check`; dims `record`, `case`, `cell`, ...;
        units in `attrs["units"]`.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    batch = record_batch(table)
    words = record_words(table)
    levels = find_levels(words)
    estimates = estimate_records(batch)
    arguments = {"data": record_data(batch), "estimates": estimates, "levels": levels}
    draws = sample(records_model, arguments, settings or SamplerSettings(), _starts(estimates, levels))
    attributes = {"origin": origin_of(table), "model": "records"}
    return to_datatree(draws.sites, draws.statistics, levels, words, attributes)


def _starts(estimates: RecordEstimates, levels: Levels) -> dict[str, np.ndarray]:
    """Return where the populations start: the medians of the records' own estimates."""
    starts = {}
    for name, log_values in (("k", np.asarray(estimates.log_k)), ("beta", np.asarray(estimates.log_beta))):
        cell_of_record = levels.cell.of_case[levels.of_record]
        cells = range(len(levels.cell.labels))
        starts[f"{name}_cell"] = np.exp([np.median(log_values[cell_of_record == cell]) for cell in cells])
    return starts


def fit_published(table: pd.DataFrame, settings: SamplerSettings | None = None) -> xr.DataTree:
    """Return what printed case means of k and beta alone support, such as Tables 9 and 11.

    Parameters
    ----------
    table:
        A row a case: the case words, `k_kN_per_mm`, `beta_mm`.
    settings:
        How much to sample.
    """
    levels = find_levels(table[list(CASE_WORDS)])
    arguments = {
        "k": jnp.asarray(table["k_kN_per_mm"].to_numpy(dtype=float)),
        "beta": jnp.asarray(table["beta_mm"].to_numpy(dtype=float)),
        "levels": levels,
    }
    draws = sample(published_model, arguments, settings or SamplerSettings())
    attributes = {"origin": "published", "model": "published"}
    return to_datatree(draws.sites, draws.statistics, levels, pd.DataFrame({"record": []}), attributes)
