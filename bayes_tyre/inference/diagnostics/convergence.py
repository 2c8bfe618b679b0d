"""How the sampler did, parameter by parameter and chain by chain."""

from typing import Any, NamedTuple

import arviz as az
import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.sampling.nuts import DEEPEST

#: The group of a posterior's tree that keeps these figures, and what stands along its dimension `figure`: each takes
#: seconds, and verdict and tables all want them.
GROUP = "convergence"
_FIGURES = ("r_hat", "ess_bulk", "ess_tail")
#: Quantiles that tail ESS is taken at, as in Vehtari et al.; ArviZ's default follows each user's settings.
TAILS = (0.05, 0.95)
#: Divergent transitions from which on where they gather can be told from chance.
_FEW_DIVERGENCES = 5


class Figures(NamedTuple):
    """R-hat, bulk and tail ESS of every element of a posterior; R-hat None with a single chain."""

    r_hat: xr.Dataset | None
    ess_bulk: xr.Dataset
    ess_tail: xr.Dataset


class Worst(NamedTuple):
    """The worst of some figures, and the element it belongs to, such as ``k_case[single (0)20-30]``."""

    value: float
    element: str


def monitor(posterior: xr.Dataset) -> Figures:
    """Return the convergence figures of each element of a posterior, dims chain, draw, ..."""

    # A probability that is 1 in every draw does not vary, and a stuck chain varies only against the others.
    with np.errstate(divide="ignore", invalid="ignore"):
        r_hat = az.rhat(posterior) if posterior.sizes["chain"] > 1 else None
        return Figures(r_hat, az.ess(posterior, method="bulk"), az.ess(posterior, method="tail", prob=TAILS))


def with_figures(tree: xr.DataTree) -> xr.DataTree:
    """Return the posterior with the group `GROUP`: the convergence figures of each element, dims figure, ..."""
    figures = monitor(tree["posterior"].to_dataset())
    none = xr.full_like(figures.ess_bulk, np.nan, dtype=float)
    each = [none if figure is None else figure for figure in figures]
    with_all = tree.copy()
    with_all[GROUP] = xr.DataTree(xr.concat(each, pd.Index(_FIGURES, name="figure")))
    return with_all


def figures_of(tree: xr.DataTree) -> Figures:
    """Return the convergence figures that a posterior's tree keeps, or take them now."""
    return (
        monitor(tree["posterior"].to_dataset()) if GROUP not in tree.children else _kept(tree, tree[GROUP].to_dataset())
    )


def figures_kept(tree: xr.DataTree, name: str) -> Figures | None:
    """Return the convergence figures of one quantity, where a posterior's tree keeps them."""
    return _kept(tree, tree[GROUP].to_dataset()[[name]]) if GROUP in tree.children and name in tree[GROUP] else None


def _kept(tree: xr.DataTree, kept: xr.Dataset) -> Figures:
    r_hat, bulk, tail = (kept.sel(figure=figure, drop=True) for figure in _FIGURES)
    return Figures(r_hat if tree["posterior"].sizes["chain"] > 1 else None, bulk, tail)


def worst(figures: xr.Dataset | None, largest: bool) -> Worst:
    """Return the worst figure and its element; what does not vary has none (NaN) and is passed over."""
    found = Worst(np.nan, "")
    for name, figure in ({} if figures is None else figures.data_vars).items():
        values = figure.to_numpy().astype(float).ravel()
        if np.isnan(values).all():
            continue
        at = int(np.nanargmax(values) if largest else np.nanargmin(values))
        if np.isnan(found.value) or (values[at] > found.value) == largest:
            where = zip(figure.dims, np.unravel_index(at, figure.shape), strict=True)
            labels = [str(figure[dim].to_numpy()[i]) for dim, i in where]
            found = Worst(float(values[at]), f"{name}[{', '.join(labels)}]" if labels else str(name))
    return found


def by_parameter(figures: Figures) -> dict[str, dict[str, Any]]:
    """Return the worst R-hat, bulk and tail ESS of each parameter and the elements they belong to, as JSON has it."""
    found: dict[str, dict[str, Any]] = {}
    for name in map(str, figures.ess_bulk.data_vars):
        each = {}
        for what, of, largest in (
            ("r_hat_max", figures.r_hat, True),
            ("ess_bulk_min", figures.ess_bulk, False),
            ("ess_tail_min", figures.ess_tail, False),
        ):
            value, element = worst(of if of is None else of[[name]], largest)
            each |= {what: value, f"{what}_at": element}
        found[name] = each
    return found


def by_chain(tree: xr.DataTree) -> list[dict[str, Any]]:
    """Return what each chain's sampler did: divergences, BFMI and, where kept, tree depths and acceptance.

    `trees_at_limit` counts the draws whose tree grew to its deepest without turning back.
    """
    statistics = tree["sample_stats"].to_dataset().transpose("chain", "draw", ...)
    bfmi = az.bfmi(tree)["energy"].to_numpy()
    found = []
    for chain in range(statistics.sizes["chain"]):
        of = statistics.isel(chain=chain)
        each = {"chain": chain, "divergences": int(of["diverging"].sum()), "bfmi": float(bfmi[chain])}
        if "n_steps" in of:
            depth = np.log2(of["n_steps"].to_numpy() + 1.0)
            each |= {"tree_depth_mean": float(np.ceil(depth).mean()), "tree_depth_max": int(np.ceil(depth).max())}
            each["trees_at_limit"] = int((depth >= DEEPEST[1]).sum())
        if "acceptance_rate" in of:
            each["acceptance_mean"] = float(of["acceptance_rate"].mean())
        found.append(each)
    return found


def odd_chain(posterior: xr.Dataset, element: str) -> int:
    """Return the chain whose draws of an element lie farthest from the others': median from median."""
    name = element.partition("[")[0]
    figures = posterior[name].transpose("chain", "draw", ...)
    values = figures.to_numpy().reshape(*figures.shape[:2], -1)
    if values.shape[2] > 1:
        dims = figures.dims[2:]
        labels = [
            f"{name}[{', '.join(str(figures[dim].to_numpy()[i]) for dim, i in zip(dims, at, strict=True))}]"
            for at in np.ndindex(*figures.shape[2:])
        ]
        values = values[:, :, [labels.index(element)]]
    medians = np.median(values[:, :, 0], axis=1)
    return int(np.argmax(np.abs(medians - np.median(medians))))


def where_divergent(tree: xr.DataTree) -> str:
    """Return the scalar whose divergent draws lie farthest to one side of its others, and which; empty for too few."""
    posterior = tree["posterior"].to_dataset()
    diverging = tree["sample_stats"].to_dataset()["diverging"].transpose("chain", "draw").to_numpy()
    count, most, found = int(diverging.sum()), 0.0, ""
    if count < _FEW_DIVERGENCES or diverging.all():
        return ""
    for name, draws in posterior.data_vars.items():
        if set(draws.dims) != {"chain", "draw"}:
            continue
        values = draws.transpose("chain", "draw").to_numpy()
        # Ranks, for scales are skewed; their mean is normal for a few draws already.
        ranks = np.argsort(np.argsort(values.ravel())).reshape(values.shape) / values.size
        off = float(ranks[diverging].mean() - 0.5) * np.sqrt(12.0 * count)
        if abs(off) > max(most, 4.0):
            most, found = abs(off), f"{'small' if off < 0 else 'large'} {name}"
    return found
