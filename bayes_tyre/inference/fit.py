"""From a table to a posterior: the two hierarchical fits, put together from their parts."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.hierarchical import published_model, records_model
from bayes_tyre.inference.levels import Levels, find_levels
from bayes_tyre.inference.likelihood import compress
from bayes_tyre.inference.picture import RecordEstimates, draw_picture, effect_estimates, record_data
from bayes_tyre.inference.posterior import to_datatree
from bayes_tyre.inference.priors import prior_medians
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
        Groups `posterior`, `sample_stats`; dims `record`, `case`, `cell`, ...;
        units in `attrs["units"]`.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    batch = record_batch(table)
    words = record_words(table)
    levels = find_levels(words)
    data, picture = record_data(batch), draw_picture(batch, levels)
    arguments = {"likelihood": compress(data), "data": data, "picture": picture, "levels": levels}
    draws = sample(records_model, arguments, settings or SamplerSettings(), _starts(picture.records, levels))
    attributes = {"origin": origin_of(table), "model": "records"}
    return to_datatree(draws.sites, draws.statistics, levels, words, attributes)


def _starts(records: RecordEstimates, levels: Levels) -> dict[str, np.ndarray]:
    """Return where the populations start: prior medians, and where the records' own estimates say more, these."""
    starts = prior_medians()
    for name, log_values in (("k", np.asarray(records.log_k)), ("beta", np.asarray(records.log_beta))):
        cell_of_record = levels.cell.of_case[levels.of_record]
        cells = range(len(levels.cell.labels))
        starts[f"{name}_cell"] = np.exp([np.median(log_values[cell_of_record == cell]) for cell in cells])
    starts["sigma_typical"] = np.asarray(np.exp(np.median(np.asarray(records.log_sigma))))
    starts["J_scale"] = np.asarray(np.sqrt(np.mean(np.asarray(records.centre[:, 1]) ** 2)) + 1e-3)
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
    columns = {"k": "k_kN_per_mm", "beta": "beta_mm"}
    values = {name: table[column].to_numpy(dtype=float) for name, column in columns.items()}
    estimates = {name: effect_estimates(np.log(printed), levels, name) for name, printed in values.items()}
    arguments = {"values": values, "estimates": estimates, "levels": levels}
    draws = sample(published_model, arguments, settings or SamplerSettings(), prior_medians())
    attributes = {"origin": "published", "model": "published"}
    return to_datatree(draws.sites, draws.statistics, levels, pd.DataFrame({"record": []}), attributes)
