"""The quantities that an answer is read by, as draws beside the posterior: means over cases, and average ratios."""

import xarray as xr

from bayes_tyre.inference.sampling.datatree import case_parameters
from bayes_tyre.inference.sampling.group_means import named_group_means
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.results.contrasts import average_ratios

#: The group of a posterior's tree that holds them.
DERIVED = "derived"


def with_derived(tree: xr.DataTree) -> xr.DataTree:
    """Return the posterior with a group `derived`, for ArviZ's functions (``group="derived"``) and for xarray.

    `k_mean`, `beta_mean` and the like, dims chain, draw, mean_of, are the rows of `summary.csv` so called, labelled by
    configuration and direction. `k_ratio`, `beta_ratio` and the like, dims chain, draw, contrast, are the rows of
    `contrasts.csv` that are averaged over all matched cases, labelled by contrast and matching.
    """
    means = named_group_means(tree)
    derived = means.drop_vars(("configuration", "direction"))
    for parameter in case_parameters(tree["posterior"].to_dataset()):
        derived[f"{parameter}_mean"].attrs["units"] = RECORD_UNITS[parameter]
        ratios = average_ratios(tree, parameter)
        if ratios.sizes["contrast"]:
            derived[f"{parameter}_ratio"] = ratios.assign_attrs(units="1")
    with_both = tree.copy()
    with_both[DERIVED] = xr.DataTree(derived.assign_attrs(tree["posterior"].attrs))
    return with_both
