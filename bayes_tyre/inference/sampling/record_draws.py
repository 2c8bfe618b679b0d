"""Fewer draws of each record than of what records share: thousands of records would fill gigabytes.

A posterior whose records were thinned keeps their labels in the group `posterior`, beside all draws of what records
share, and their draws in a group of their own, whose coordinate `draw` says which of each chain's draws they are.
"""

import numpy as np
import xarray as xr

#: The group of a posterior's tree that holds the records' draws where they were thinned.
GROUP = "record_draws"
#: Most records whose draws are all kept unless asked otherwise; and the draws, of all chains, kept of more.
MOST_RECORDS, KEPT = 2000, 200


def thin_records(tree: xr.DataTree, most_draws: int | None = None, most_records: int = MOST_RECORDS) -> xr.DataTree:
    """Return a posterior with about `most_draws` draws of each record, evenly spaced, the same number of each chain.

    Parameters
    ----------
    tree:
        A posterior with all draws of its records, or of no records; it is returned as it is where none are to go.
    most_draws:
        Draws of all chains; None: `KEPT` of more than `most_records` records, else all.
    most_records:
        See `most_draws`.
    """
    posterior = tree["posterior"].to_dataset()
    of_records = [name for name, draws in posterior.data_vars.items() if "record" in draws.dims]
    if most_draws is None:
        most_draws = KEPT if of_records and posterior.sizes["record"] > most_records else None
    chains, draws = posterior.sizes["chain"], posterior.sizes["draw"]
    if not of_records or most_draws is None or most_draws >= chains * draws:
        return tree
    each = np.unique(np.linspace(0, draws - 1, max(1, most_draws // chains)).round().astype(int))
    thinned = tree.copy()
    thinned["posterior"] = xr.DataTree(posterior.drop_vars(of_records))
    thinned[GROUP] = xr.DataTree(posterior[of_records].isel(draw=each))
    return thinned


def with_records(tree: xr.DataTree) -> xr.Dataset:
    """Return the draws of a posterior that hold everything: all, or those that are left of its records."""
    posterior = tree["posterior"].to_dataset()
    if GROUP not in tree.children:
        return posterior
    of_records = tree[GROUP].to_dataset()
    return posterior.sel(draw=of_records["draw"]).assign(of_records.data_vars)
