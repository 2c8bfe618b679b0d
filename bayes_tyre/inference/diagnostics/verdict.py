"""The verdict: whether a posterior may be trusted, and if not, which parameter says so and what to do."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from bayes_tyre.inference.correlated_noise import SMOOTHED
from bayes_tyre.inference.diagnostics.convergence import TAILS as TAILS  # others take it from here
from bayes_tyre.inference.diagnostics.convergence import (
    Figures,
    Worst,
    by_chain,
    by_parameter,
    discordant_chain,
    figures_of,
    where_divergent,
    worst,
)
from bayes_tyre.inference.diagnostics.data_checks import failed_checks, find_limitations
from bayes_tyre.inference.sampling.datatree import priors_of

R_HAT_MOST = 1.01
ESS_LEAST_PER_CHAIN = 100
BFMI_LEAST = 0.3
#: Lag-1 autocorrelation of residuals above which independent noise is not credible. Over records of a hundred
#: points its standard error is 0.1 for one record, far less for their median.
AUTOCORRELATION_MOST = 0.3
_MORE = "raise --warmup and --draws"
_REMEDY = "fit with --noise ar1, or with unsmoothed signals"
_REMEDY_SMOOTHED = (
    "the signals look smoothed, and beta then reflects the filter: no noise model helps, use the raw ones"
)


class Diagnostics(NamedTuple):
    """What `diagnostics.json` holds.

    Attributes
    ----------
    verdict:
        ``pass`` or ``fail``.
    reasons:
        One sentence each: the parameter or the chain, the figure, and what to do.
    r_hat_max, ess_bulk_min, ess_tail_min, bfmi_min:
        The worst over all parameters (chains); NaN where they do not exist.
    residual_autocorrelation:
        Median over records of the residuals' lag-1 autocorrelation; NaN without records.
    limitations:
        What a reader should know and that fails nothing, such as weakly identified quantities: one sentence each.
    by_parameter, by_chain:
        The figures of each parameter and of each chain's sampler, as
        `bayes_tyre.inference.diagnostics.convergence` has them.
    """

    verdict: str
    reasons: tuple[str, ...]
    r_hat_max: float
    ess_bulk_min: float
    ess_tail_min: float
    divergences: int
    bfmi_min: float
    draws: int
    chains: int
    residual_autocorrelation: float
    limitations: tuple[str, ...] = ()
    by_parameter: dict[str, dict[str, Any]] = {}  # noqa: RUF012  (a field of a named tuple, never changed)
    by_chain: list[dict[str, Any]] = []  # noqa: RUF012


def _not_finite(posterior: xr.Dataset) -> list[str]:
    return [str(name) for name, draws in posterior.data_vars.items() if not np.isfinite(draws.to_numpy()).all()]


def diagnose(tree: xr.DataTree, residual_autocorrelation: float = np.nan) -> Diagnostics:
    """Return the verdict on a posterior, from every quantity it holds.

    Pass: R-hat <= 1.01, bulk and tail ESS >= 100 a chain, BFMI >= 0.3, no divergence, finite draws, residuals that
    do not follow each other, and no doubt of `bayes_tyre.inference.diagnostics.data_checks` about the records. Negative
    autocorrelation passes: a fit to few points leaves it, and it narrows no interval. Source: Vehtari et al. (2021),
    "Rank-normalization, folding, and localization".

    Parameters
    ----------
    tree:
        A posterior as `bayes_tyre.inference.sampling.datatree.to_datatree` gives it.
    residual_autocorrelation:
        Lag-1 autocorrelation of the residuals, where there are records.
    """
    posterior = tree["posterior"].to_dataset()
    chains, draws = posterior.sizes["chain"], posterior.sizes["draw"]
    figures, sampler = figures_of(tree), by_chain(tree)
    r_hat, bulk = worst(figures.r_hat, largest=True), worst(figures.ess_bulk, largest=False)
    tail = worst(figures.ess_tail, largest=False)
    reasons = [f"{name}: draws are not finite; check the scales of the records" for name in _not_finite(posterior)]
    reasons += [
        *_disagreement(posterior, figures, r_hat),
        *_few(figures, bulk, tail, chains),
        *_unexplored(tree, sampler),
    ]
    if residual_autocorrelation > AUTOCORRELATION_MOST:
        reasons.append(
            f"sigma: residuals have lag-1 autocorrelation {residual_autocorrelation:.2f}: intervals are too narrow; "
            f"{_REMEDY_SMOOTHED if residual_autocorrelation > SMOOTHED else _REMEDY}"
        )
    reasons += failed_checks(posterior, priors_of(tree))
    return Diagnostics(
        "fail" if reasons else "pass",
        tuple(reasons),
        r_hat.value,
        bulk.value,
        tail.value,
        sum(chain["divergences"] for chain in sampler),
        float(np.min([chain["bfmi"] for chain in sampler])),
        draws,
        chains,
        residual_autocorrelation,
        (*_deep_trees(sampler, draws), *find_limitations(tree)),
        by_parameter(figures),
        sampler,
    )


def _others(bad: int) -> str:
    return f" ({bad - 1} more in by_parameter)" if bad > 1 else ""


def _disagreement(posterior: xr.Dataset, figures: Figures, found: Worst) -> Iterator[str]:
    if figures.r_hat is None:
        yield "one chain cannot be compared with another: use --chains 4"
    elif not found.value <= R_HAT_MOST:
        bad = sum(bool((figure > R_HAT_MOST).any()) for figure in figures.r_hat.data_vars.values())
        chain = f"chain {discordant_chain(posterior, found.element)} most" if found.element else "all of them"
        yield (
            f"{found.element}: R-hat {found.value:.3f} is above {R_HAT_MOST}{_others(bad)}: chains disagree, {chain}; "
            f"{_MORE}"
        )


def _few(figures: Figures, bulk: Worst, tail: Worst, chains: int) -> Iterator[str]:
    least = ESS_LEAST_PER_CHAIN * chains
    for kind, found, of in (("bulk", bulk, figures.ess_bulk), ("tail", tail, figures.ess_tail)):
        if not found.value >= least:
            bad = sum(bool((figure < least).any()) for figure in of.data_vars.values())
            yield (
                f"{found.element}: {kind} ESS {found.value:.0f} is below {ESS_LEAST_PER_CHAIN} a chain{_others(bad)}; "
                f"{_MORE}"
            )


def _unexplored(tree: xr.DataTree, sampler: list[dict[str, Any]]) -> Iterator[str]:
    stiff = min(sampler, key=lambda chain: chain["bfmi"])
    if not stiff["bfmi"] >= BFMI_LEAST:
        yield (
            f"energy: BFMI {stiff['bfmi']:.2f} of chain {stiff['chain']} is below {BFMI_LEAST}: tails are not "
            "explored; raise --warmup"
        )
    divergent = [chain for chain in sampler if chain["divergences"]]
    if divergent:
        total = sum(chain["divergences"] for chain in divergent)
        each = ", ".join(f"{chain['divergences']} in chain {chain['chain']}" for chain in divergent)
        where = where_divergent(tree)
        yield (
            f"{total} divergent transitions ({each}{f'; most at {where}' if where else ''}): part of the posterior was "
            f"not reached; {_MORE}"
        )


def _deep_trees(sampler: list[dict[str, Any]], draws: int) -> Iterator[str]:
    for chain in sampler:
        if at_limit := chain.get("trees_at_limit"):
            yield (
                f"chain {chain['chain']}: {at_limit} of {draws} trees grew to their limit of depth "
                f"{chain['tree_depth_max']}: sampling was slow there; raise --warmup"
            )
