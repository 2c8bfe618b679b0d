"""Where a posterior's tree has the factors of its cases and records: beside its draws, or in ArviZ's `constant_data`.

Computations select draws by them, as coordinates of the group `posterior`. ArviZ stacks the variables of that group,
and all would need the same coordinates: so in files, and in the hands of users, they are a group of their own.
"""

import xarray as xr

GROUP, _OF = "constant_data", "posterior"


def set_apart(tree: xr.DataTree) -> xr.DataTree:
    """Return a tree of the same data with the coordinates that are no dimension in the group `constant_data`."""
    if _OF not in tree.children:
        return tree
    draws = tree[_OF].to_dataset()
    beside = [str(name) for name in draws.coords if name not in draws.dims]
    if not beside:
        return tree
    apart = tree.copy()
    apart[_OF] = xr.DataTree(draws.drop_vars(beside))
    apart[GROUP] = xr.DataTree(draws[beside].reset_coords().drop_attrs(deep=False))
    return apart


def put_together(tree: xr.DataTree) -> xr.DataTree:
    """Return a tree of the same data with the variables of `constant_data` as coordinates of the posterior.

    Raises
    ------
    ValueError
        If they are of other cases or records than the draws.
    """
    if _OF not in tree.children or GROUP not in tree.children:
        return tree
    draws, constants = tree[_OF].to_dataset(), tree[GROUP].to_dataset()
    constants, draws = xr.align(constants, draws, join="exact", copy=False)
    together = tree.copy()
    together[_OF] = xr.DataTree(draws.assign_coords(constants.data_vars))
    del together[GROUP]
    return together
