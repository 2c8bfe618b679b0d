"""The verdict: whether a posterior may be trusted, and if not, which parameter says so and what to do."""

from typing import NamedTuple

import arviz as az
import numpy as np
import xarray as xr

from bayes_tyre.inference.doubts import find_doubts
from bayes_tyre.inference.noise import SMOOTHED

R_HAT_MOST = 1.01
ESS_LEAST_PER_CHAIN = 100
BFMI_LEAST = 0.3
#: Quantiles that tail ESS is taken at, as in Vehtari et al.; ArviZ's default follows each user's settings.
TAILS = (0.05, 0.95)
#: Lag-1 autocorrelation of residuals above which independent noise is not credible. Over records of a hundred
#: points its standard error is 0.1 for one record, far less for their median.
AUTOCORRELATION_MOST = 0.3
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
        One sentence each: the parameter, the figure, and what to do.
    r_hat_max, ess_bulk_min, ess_tail_min, bfmi_min:
        The worst over all parameters (chains); NaN where they do not exist.
    residual_autocorrelation:
        Median over records of the residuals' lag-1 autocorrelation; NaN without records.
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


class _Worst(NamedTuple):
    value: float
    parameter: str


def _worst(figures: xr.Dataset, largest: bool) -> _Worst:
    """Return the worst figure and the element it belongs to; what does not vary has none (NaN) and is passed over."""
    found = _Worst(np.nan, "")
    for name, figure in figures.data_vars.items():
        values = figure.to_numpy().astype(float).ravel()
        if np.isnan(values).all():
            continue
        at = int(np.nanargmax(values) if largest else np.nanargmin(values))
        if np.isnan(found.value) or (values[at] > found.value) == largest:
            where = zip(figure.dims, np.unravel_index(at, figure.shape), strict=True)
            labels = [str(figure[dim].to_numpy()[i]) for dim, i in where]
            found = _Worst(float(values[at]), f"{name}[{', '.join(labels)}]" if labels else str(name))
    return found


def _not_finite(posterior: xr.Dataset) -> list[str]:
    return [str(name) for name, draws in posterior.data_vars.items() if not np.isfinite(draws.to_numpy()).all()]


def diagnose(tree: xr.DataTree, residual_autocorrelation: float = np.nan) -> Diagnostics:
    """Return the verdict on a posterior, from every quantity it holds.

    Pass: R-hat <= 1.01, bulk and tail ESS >= 100 a chain, BFMI >= 0.3, no divergence, finite draws, residuals that
    do not follow each other, and no doubt of `bayes_tyre.inference.doubts` about the records. Negative
    autocorrelation passes: a fit to few points leaves it, and it narrows no interval. Source: Vehtari et al. (2021),
    "Rank-normalization, folding, and localization".

    Parameters
    ----------
    tree:
        A posterior as `bayes_tyre.inference.posterior.to_datatree` gives it.
    residual_autocorrelation:
        Lag-1 autocorrelation of the residuals, where there are records.
    """
    posterior = tree["posterior"].to_dataset()
    chains, draws = posterior.sizes["chain"], posterior.sizes["draw"]
    # A probability that is 1 in every draw does not vary, and a stuck chain varies only against the others.
    with np.errstate(divide="ignore", invalid="ignore"):
        r_hat = _worst(az.rhat(posterior), largest=True) if chains > 1 else _Worst(np.nan, "")
        bulk = _worst(az.ess(posterior, method="bulk"), largest=False)
        tail = _worst(az.ess(posterior, method="tail", prob=TAILS), largest=False)
    bfmi = float(np.min(az.bfmi(tree)["energy"].to_numpy()))
    divergences = int(tree["sample_stats"].to_dataset()["diverging"].sum())
    more = "raise --warmup and --draws"
    reasons = [f"{name}: draws are not finite; check the scales of the records" for name in _not_finite(posterior)]
    if chains < 2:
        reasons.append("one chain cannot be compared with another: use --chains 4")
    elif not r_hat.value <= R_HAT_MOST:
        reasons.append(f"{r_hat.parameter}: R-hat {r_hat.value:.3f} is above {R_HAT_MOST}: chains disagree; {more}")
    for kind, worst in (("bulk", bulk), ("tail", tail)):
        if not worst.value >= ESS_LEAST_PER_CHAIN * chains:
            reasons.append(
                f"{worst.parameter}: {kind} ESS {worst.value:.0f} is below {ESS_LEAST_PER_CHAIN} a chain; {more}"
            )
    if not bfmi >= BFMI_LEAST:
        reasons.append(f"energy: BFMI {bfmi:.2f} is below {BFMI_LEAST}: tails are not explored; raise --warmup")
    if divergences:
        reasons.append(f"{divergences} divergent transitions: part of the posterior was not reached; {more}")
    if residual_autocorrelation > AUTOCORRELATION_MOST:
        reasons.append(
            f"sigma: residuals have lag-1 autocorrelation {residual_autocorrelation:.2f}: intervals are too narrow; "
            f"{_REMEDY_SMOOTHED if residual_autocorrelation > SMOOTHED else _REMEDY}"
        )
    reasons += find_doubts(posterior)
    return Diagnostics(
        "fail" if reasons else "pass",
        tuple(reasons),
        r_hat.value,
        bulk.value,
        tail.value,
        divergences,
        bfmi,
        draws,
        chains,
        residual_autocorrelation,
    )
