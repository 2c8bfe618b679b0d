"""The parameters of populations: a group's k and beta, standard deviations, with their draws by chain."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float

from bayes_tyre.inference.model.hyperparameters import MOTION_PARAMETERS
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.record import LAW_PARAMETERS

#: Parameters whose groups a pair plot shows.
_PAIRED = ("k", "settled", "beta")
#: What a pair plot shows beside the groups, the first first: where funnels and ridges would stand.
MAIN_SCALES = tuple(
    name.format(parameter)
    for name in ("sd_log_{}_case", "sd_log_{}_repeat", "sd_log_{}_published")
    for parameter in _PAIRED
)
#: The most parameters of a pair plot, and how many of them may be of groups.
MOST_PAIRED, MOST_GROUPS = 10, 8


class Hyperparameter(NamedTuple):
    """One parameter of a population.

    Attributes
    ----------
    name, unit:
        As `summary.csv` has them, such as ``k_group[dual loading]``; the unit of a pure number is empty.
    configuration:
        Whose it is; None where it belongs to all.
    draws:
        Shape (chains, draws).
    """

    name: str
    unit: str
    configuration: str | None
    draws: Float[np.ndarray, "chains draws"]

    @property
    def varies(self) -> bool:
        """Whether its draws are finite and not all the same."""
        return bool(np.isfinite(self.draws).all() and np.ptp(self.draws) > 0)


def hyperparameters(tree: xr.DataTree) -> list[Hyperparameter]:
    """Return k, beta and more of each configuration and direction, then every scalar of the posterior in its order.

    Effects of single speeds, loads and steps, cases and records are left to `summary.csv`: there are too many.
    """
    posterior = tree["posterior"].to_dataset()
    parameters = []
    for parameter in dict.fromkeys((*MOTION_PARAMETERS, *LAW_PARAMETERS)):
        if f"{parameter}_group" in posterior:
            parameters += _groups(posterior, f"{parameter}_group")
    for name, draws in posterior.data_vars.items():
        if set(draws.dims) == {"chain", "draw"}:
            parameters.append(Hyperparameter(str(name), _unit(draws), None, _array(draws)))
    return parameters


def _groups(posterior: xr.Dataset, name: str) -> list[Hyperparameter]:
    whose = {case.group: case.configuration or "" for case in tree_cases(posterior)}
    of_group = posterior[name]
    labels = [str(label) for label in of_group["group"].to_numpy()] if "group" in of_group.coords else [""]
    return [
        Hyperparameter(
            f"{name}[{label}]" if label else name, _unit(of_group), whose.get(label, ""), _array(of_group.isel(group=i))
        )
        for i, label in enumerate(labels)
    ]


def _array(draws: xr.DataArray) -> np.ndarray:
    return draws.transpose("chain", "draw").to_numpy().astype(float)


def _unit(draws: xr.DataArray) -> str:
    unit = str(draws.attrs.get("units", ""))
    return "" if unit == "1" else unit


def paired(parameters: list[Hyperparameter]) -> list[Hyperparameter]:
    """Return those that a pair plot shows: k and beta of the first groups, then the main others, ten at most."""
    groups = [[p for p in parameters if p.name.startswith(f"{parameter}_group")] for parameter in _PAIRED]
    each = MOST_GROUPS // max(2, sum(map(bool, groups)))
    shown = [p for of_parameter in groups for p in of_parameter[:each]]
    by_name = {p.name: p for p in parameters}
    shown += [by_name[name] for name in MAIN_SCALES if name in by_name]
    return [p for p in shown if p.varies][:MOST_PAIRED]


def divergences(tree: xr.DataTree) -> Bool[np.ndarray, "chains draws"]:
    """Return which draws ended a transition that diverged."""
    diverging = tree["sample_stats"].to_dataset()["diverging"]
    return diverging.transpose("chain", "draw").to_numpy().astype(bool)
