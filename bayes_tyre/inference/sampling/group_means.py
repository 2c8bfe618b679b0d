"""Means over the cases of a group (configuration x direction), at each draw: the quantity that results are read by."""

import xarray as xr

from bayes_tyre.inference.sampling.datatree import case_parameters, tree_cases
from bayes_tyre.record import CASE_FACTORS


def group_means(tree: xr.DataTree) -> xr.Dataset:
    """Return the mean of k (kN/mm), beta (mm) and what else cases have, over those of a configuration and direction.

    The arithmetic mean of the cases, as the source's Tables 9 and 11 average them; dims chain, draw, group, with
    `configuration` and `direction` along group.
    """
    posterior = tree["posterior"].to_dataset()
    keys = [(case.configuration, case.direction) for case in tree_cases(posterior)]
    groups = sorted(set(keys))
    means = {}
    for parameter in case_parameters(posterior):
        of_case = posterior[f"{parameter}_case"]
        by_group = [of_case.isel(case=[key == group for key in keys]).mean("case") for group in groups]
        means[parameter] = xr.concat(by_group, dim="group").transpose("chain", "draw", "group")
    factor_table = {word: ("group", [group[i] for group in groups]) for i, word in enumerate(CASE_FACTORS[:2])}
    return xr.Dataset(means).assign_coords(factor_table)


def named_group_means(tree: xr.DataTree) -> xr.Dataset:
    """Return `group_means` as `summary.csv` names them: `k_mean`, `beta_mean`, dims chain, draw, mean_of.

    Along `mean_of` they are labelled by configuration and direction, beside these two by themselves.
    """
    means = group_means(tree)
    groups = zip(means["configuration"].to_numpy(), means["direction"].to_numpy(), strict=True)
    # A table without a factor has none of its levels.
    labels = [" ".join(level for level in group if isinstance(level, str) and level) for group in groups]
    means = means.assign_coords(group=labels)
    return means.rename({name: f"{name}_mean" for name in means.data_vars} | {"group": "mean_of"})
