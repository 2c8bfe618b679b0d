"""The records that a posterior was fitted to, in its order: what is computed of both takes them row by row."""

import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.prepared_records import record_batch, used_points
from bayes_tyre.inference.sampling.datatree import RECORDS_DIGEST, model_of


def fitted_records(tree: xr.DataTree, table: pd.DataFrame) -> pd.DataFrame:
    """Return a checked record table, all its points (mm, kN), with its records in the order of a posterior's.

    Parameters
    ----------
    tree, table:
        A posterior of records, and the table that it was fitted to, its records in any order.

    Raises
    ------
    BadInput
        For records that are not those of the posterior.
    """
    by_name = {str(name): rows for name, rows in table.groupby("record", sort=False)}
    names = [str(name) for name in tree["posterior"]["record"].to_numpy()]
    if set(by_name) != set(names):
        other = min(set(by_name) ^ set(names))
        raise BadInput(
            f"these are not the records that the posterior was fitted to: {other!r} is in one of them only; give the "
            "same table"
        )
    table = pd.concat([by_name[name] for name in names], ignore_index=True)
    digest = record_batch(used_points(table, model_of(tree).region)).digest
    if tree.attrs.get(RECORDS_DIGEST, digest) != digest:
        raise BadInput("the readings are not those that the posterior was fitted to; give the same table")
    return table
