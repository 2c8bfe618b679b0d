"""Convergence statistics of a posterior, by parameter and by chain: R-hat, ESS, divergences, BFMI, tree depth."""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from arviz_stats import sampling_diagnostics

from bayes_tyre.inference.sampling.common_scales import as_measured, of_factors
from bayes_tyre.inference.sampling.effective_sizes import statistics
from bayes_tyre.inference.sampling.resonance import DEEPEST

#: The group of a posterior's tree that holds these statistics, because each takes seconds and several tables use them;
#: and the labels along its dimension `figure`.
GROUP = "convergence"
_STATISTICS = ("r_hat", "ess_bulk", "ess_tail", "mcse_mean")
#: Fewest divergent transitions whose place in the posterior is distinguishable from chance.
_FEW_DIVERGENCES = 5


class ConvergenceStatistics(NamedTuple):
    """R-hat, bulk and tail ESS, Monte Carlo error of the mean of every element of a posterior.

    R-hat is None with a single chain.
    """

    r_hat: xr.Dataset | None
    ess_bulk: xr.Dataset
    ess_tail: xr.Dataset
    mcse_mean: xr.Dataset


class Worst(NamedTuple):
    """The worst value of a statistic, and the element it belongs to, such as ``k_case[single (0)20-30]``."""

    value: float
    element: str


def monitor(posterior: xr.Dataset) -> ConvergenceStatistics:
    """Return the convergence statistics of each element of a posterior, dims chain, draw, ...

    R-hat and ESS are those of what was sampled: a common factor on it (`sampling.common_scales`) is independent between
    draws, and would hide chains that disagree. The error of the mean is that of the factor's draws too. What was
    computed with a factor, such as the energy of a cycle, has it in all of them.
    """
    by_quantity: dict[str, list[xr.DataArray]] = {}
    measured, scaled = as_measured(posterior), of_factors(posterior)
    for name, draws in posterior.data_vars.items():
        each = _of_elements(measured[name])
        by_quantity[str(name)] = [*each[:-1], _of_elements(draws)[-1]] if name in scaled else each
    r_hat, *others = (
        xr.Dataset({name: each[i] for name, each in by_quantity.items()}) for i in range(len(_STATISTICS))
    )
    return ConvergenceStatistics(r_hat if posterior.sizes["chain"] > 1 else None, *others)


def _of_elements(draws: xr.DataArray) -> list[xr.DataArray]:
    """Return `_STATISTICS` of each element of a quantity."""
    sample = draws.transpose("chain", "draw", ...)
    like = sample.isel(chain=0, draw=0, drop=True).drop_attrs()
    values = sample.to_numpy()
    each = statistics(values.reshape(*values.shape[:2], -1))
    return [like.copy(data=statistic.reshape(like.shape)) for statistic in each]


def with_statistics(tree: xr.DataTree) -> xr.DataTree:
    """Return the posterior with the group `GROUP`: the convergence statistics of each element, dims figure, ..."""
    computed = monitor(tree["posterior"].to_dataset())
    missing = xr.full_like(computed.ess_bulk, np.nan, dtype=float)
    filled = [missing if statistic is None else statistic for statistic in computed]
    with_group = tree.copy()
    with_group[GROUP] = xr.DataTree(xr.concat(filled, pd.Index(_STATISTICS, name="figure")))
    return with_group


def statistics_of(tree: xr.DataTree) -> ConvergenceStatistics:
    """Return the convergence statistics that a posterior's tree holds, or compute them."""
    return _from_group(tree, tree[GROUP].to_dataset()) if _holds(tree) else monitor(tree["posterior"].to_dataset())


def stored_statistics(tree: xr.DataTree, name: str) -> ConvergenceStatistics | None:
    """Return the convergence statistics of one quantity, where a posterior's tree holds them."""
    return _from_group(tree, tree[GROUP].to_dataset()[[name]]) if _holds(tree) and name in tree[GROUP] else None


def _holds(tree: xr.DataTree) -> bool:
    """Return whether a tree has all statistics: those of earlier versions do not."""
    return GROUP in tree.children and set(_STATISTICS) <= set(tree[GROUP]["figure"].to_numpy())


def _from_group(tree: xr.DataTree, group: xr.Dataset) -> ConvergenceStatistics:
    r_hat, *others = (group.sel(figure=name, drop=True) for name in _STATISTICS)
    return ConvergenceStatistics(r_hat if tree["posterior"].sizes["chain"] > 1 else None, *others)


def worst(statistic: xr.Dataset | None, largest: bool) -> Worst:
    """Return the worst value and its element; an element that does not vary has NaN and is passed over."""
    result = Worst(np.nan, "")
    for name, elements in ({} if statistic is None else statistic.data_vars).items():
        values = elements.to_numpy().astype(float).ravel()
        if np.isnan(values).all():
            continue
        at = int(np.nanargmax(values) if largest else np.nanargmin(values))
        if np.isnan(result.value) or (values[at] > result.value) == largest:
            where = zip(elements.dims, np.unravel_index(at, elements.shape), strict=True)
            labels = [str(elements[dim].to_numpy()[i]) for dim, i in where]
            result = Worst(float(values[at]), f"{name}[{', '.join(labels)}]" if labels else str(name))
    return result


def by_parameter(statistics: ConvergenceStatistics) -> dict[str, dict[str, Any]]:
    """Return the worst R-hat, bulk and tail ESS of each parameter, and their elements, for `diagnostics.json`."""
    rows: dict[str, dict[str, Any]] = {}
    for name in map(str, statistics.ess_bulk.data_vars):
        row = {}
        for key, statistic, largest in (
            ("r_hat_max", statistics.r_hat, True),
            ("ess_bulk_min", statistics.ess_bulk, False),
            ("ess_tail_min", statistics.ess_tail, False),
        ):
            value, element = worst(statistic if statistic is None else statistic[[name]], largest)
            row |= {key: value, f"{key}_at": element}
        rows[name] = row
    return rows


def by_chain(tree: xr.DataTree) -> list[dict[str, Any]]:
    """Return each chain's divergences, BFMI and, where recorded, tree depths and acceptance.

    `trees_at_limit` counts the draws whose tree reached the depth limit before a U-turn.
    """
    sampled = tree["sample_stats"].to_dataset().transpose("chain", "draw", ...)
    bfmi = sampling_diagnostics.bfmi(tree)["energy"].to_numpy()
    rows = []
    for chain in range(sampled.sizes["chain"]):
        one = sampled.isel(chain=chain)
        row = {"chain": chain, "divergences": int(one["diverging"].sum()), "bfmi": float(bfmi[chain])}
        if "n_steps" in one:
            depth = np.log2(one["n_steps"].to_numpy() + 1.0)
            row |= {"tree_depth_mean": float(np.ceil(depth).mean()), "tree_depth_max": int(np.ceil(depth).max())}
            row["trees_at_limit"] = int((depth >= DEEPEST[1]).sum())
        if "acceptance_rate" in one:
            row["acceptance_mean"] = float(one["acceptance_rate"].mean())
        rows.append(row)
    return rows


def discordant_chain(posterior: xr.Dataset, element: str) -> int:
    """Return the chain whose median of an element is farthest from the median of all chains' medians."""
    name = element.partition("[")[0]
    draws = posterior[name].transpose("chain", "draw", ...)
    values = draws.to_numpy().reshape(*draws.shape[:2], -1)
    if values.shape[2] > 1:
        dims = draws.dims[2:]
        labels = [
            f"{name}[{', '.join(str(draws[dim].to_numpy()[i]) for dim, i in zip(dims, at, strict=True))}]"
            for at in np.ndindex(*draws.shape[2:])
        ]
        values = values[:, :, [labels.index(element)]]
    medians = np.median(values[:, :, 0], axis=1)
    return int(np.argmax(np.abs(medians - np.median(medians))))


def where_divergent(tree: xr.DataTree) -> str:
    """Return ``small NAME`` or ``large NAME``: where divergent draws are most extreme; empty for too few of them."""
    posterior = tree["posterior"].to_dataset()
    diverging = tree["sample_stats"].to_dataset()["diverging"].transpose("chain", "draw").to_numpy()
    count, most, place = int(diverging.sum()), 0.0, ""
    if count < _FEW_DIVERGENCES or diverging.all():
        return ""
    for name, draws in posterior.data_vars.items():
        if set(draws.dims) != {"chain", "draw"}:
            continue
        values = draws.transpose("chain", "draw").to_numpy()
        # Ranks, because standard deviations are skewed; the mean of a few ranks is already close to normal.
        ranks = np.argsort(np.argsort(values.ravel())).reshape(values.shape) / values.size
        off = float(ranks[diverging].mean() - 0.5) * np.sqrt(12.0 * count)
        if abs(off) > max(most, 4.0):
            most, place = abs(off), f"{'small' if off < 0 else 'large'} {name}"
    return place
