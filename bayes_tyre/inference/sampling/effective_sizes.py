"""R-hat, effective sample sizes and Monte Carlo errors of many quantities at once: ArviZ takes them one by one."""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import special, stats
from scipy.fft import next_fast_len

#: What a posterior needs: R-hat at most this of every quantity, and effective samples of so many a chain.
R_HAT_MOST = 1.01
ESS_LEAST_PER_CHAIN = 100
#: Quantiles at which tail ESS is computed, as in Vehtari et al.; ArviZ's default follows each user's settings.
TAILS = (0.05, 0.95)
#: Numbers that one batch of quantities may have: it then stays in the processor's cache.
_BATCH = 200_000
#: Fewest draws of a chain for which these statistics exist.
_LEAST_DRAWS = 4


class Statistics(NamedTuple):
    """Of each quantity: R-hat (NaN with a single chain), bulk and tail ESS, Monte Carlo error of its mean."""

    r_hat: Float[np.ndarray, " quantities"]
    ess_bulk: Float[np.ndarray, " quantities"]
    ess_tail: Float[np.ndarray, " quantities"]
    mcse_mean: Float[np.ndarray, " quantities"]


def statistics(draws: Float[np.ndarray, "chains draws quantities"]) -> Statistics:
    """Return the convergence statistics of each quantity; NaN where draws are, and for fewer than four a chain.

    They are `arviz.rhat`, `arviz.ess` (bulk; tail at `TAILS`) and `arviz.mcse` to rounding, for a hundredth of a second
    a hundred quantities. Source: Vehtari et al. (2021), "Rank-normalization, folding, and localization"; Geyer (1992),
    "Practical Markov chain Monte Carlo".
    """
    chains, length, quantities = draws.shape
    computed = np.full((len(Statistics._fields), quantities), np.nan)
    step = max(1, _BATCH // max(1, chains * length))

    def compute(start: int) -> None:
        batch = np.ascontiguousarray(np.moveaxis(draws[:, :, start : start + step], 2, 0), dtype=float)
        without_nan = ~np.isnan(batch).any(axis=(1, 2))
        if without_nan.any():
            computed[:, start : start + step][:, without_nan] = _of_batch(batch[without_nan])

    if length >= _LEAST_DRAWS:
        with ThreadPoolExecutor(os.cpu_count()) as threads:  # sorting and transforms release the interpreter
            list(threads.map(compute, range(0, quantities, step)))
    return Statistics(*computed)


def falls_short(draws: Float[np.ndarray, "chains draws quantities"]) -> bool:
    """Return whether any quantity that varies has an R-hat above, or an ESS below, what a posterior needs."""
    convergence, least = statistics(draws), ESS_LEAST_PER_CHAIN * len(draws)
    sizes = np.minimum(convergence.ess_bulk, convergence.ess_tail)
    return bool((convergence.r_hat > R_HAT_MOST).any() or (sizes < least).any())


def _of_batch(draws: Float[np.ndarray, "quantities chains draws"]) -> Float[np.ndarray, "4 quantities"]:
    flat = draws.reshape(len(draws), -1)
    halves = _halves(draws)
    with np.errstate(divide="ignore", invalid="ignore"):  # what does not vary has no R-hat
        scores = _normal_scores(halves)
        r_hat = np.full(len(draws), np.nan)
        if draws.shape[1] > 1:
            middle = np.median(halves, axis=(1, 2), keepdims=True)
            bulk, folded = _r_hat(scores), _r_hat(_normal_scores(np.abs(halves - middle)))
            r_hat = np.where(folded > bulk, folded, bulk)
        low, high = (
            _effective_size(_halves((flat <= limit[:, None]).reshape(draws.shape).astype(float)))
            for limit in np.quantile(flat, TAILS, axis=1)
        )
        error = flat.std(axis=1, ddof=1) / np.sqrt(_effective_size(halves))
        return np.stack([r_hat, _effective_size(scores), np.where(high < low, high, low), error])


def _halves(draws: Float[np.ndarray, "quantities chains draws"]) -> Float[np.ndarray, "quantities halves half"]:
    """Return the first and the second half of each chain as chains of their own."""
    half = draws.shape[2] // 2
    return np.concatenate([draws[:, :, :half], draws[:, :, -half:]], axis=1)


def _normal_scores(
    draws: Float[np.ndarray, "quantities chains draws"],
) -> Float[np.ndarray, "quantities chains draws"]:
    """Return the normal quantile of each draw's rank, equal draws at their mean rank (Blom 1958)."""
    flat = draws.reshape(len(draws), -1)
    order = np.argsort(flat, axis=1)
    scores = np.empty_like(flat)
    np.put_along_axis(scores, order, _score(np.arange(1.0, flat.shape[1] + 1.0), flat.shape[1])[None], axis=1)
    tied = (np.diff(np.take_along_axis(flat, order, axis=1), axis=1) == 0.0).any(axis=1)
    scores[tied] = _score(stats.rankdata(flat[tied], axis=1), flat.shape[1])
    return scores.reshape(draws.shape)


def _score(ranks: Float[np.ndarray, "..."], size: int) -> Float[np.ndarray, "..."]:
    return special.ndtri((ranks - 0.375) / (size + 0.25))


def _r_hat(draws: Float[np.ndarray, "quantities chains draws"]) -> Float[np.ndarray, " quantities"]:
    length = draws.shape[2]
    between = length * draws.mean(axis=2).var(axis=1, ddof=1)
    within = draws.var(axis=2, ddof=1).mean(axis=1)
    return np.sqrt((between / within + length - 1) / length)


def _effective_size(draws: Float[np.ndarray, "quantities chains draws"]) -> Float[np.ndarray, " quantities"]:
    """Return the effective sample size of each mean, by Geyer's initial monotone sequence."""
    _, chains, length = draws.shape
    size = chains * length
    means = draws.mean(axis=2)
    padded = next_fast_len(2 * length, real=True)
    spectrum = np.fft.rfft(draws - means[:, :, None], n=padded, axis=2)
    power = (spectrum.real**2 + spectrum.imag**2).mean(axis=1)
    covariance = np.fft.irfft(power, n=padded, axis=1)[:, :length] / length
    of_mean = means.var(axis=1, ddof=1) if chains > 1 else np.zeros(len(draws))
    within, total = covariance[:, :1] * length / (length - 1.0), covariance[:, :1] + of_mean[:, None]
    correlation = 1.0 - (within - covariance) / total
    correlation[:, 0] = 1.0
    time = np.maximum(_correlation_time(correlation), 1.0 / np.log10(size))
    ess = np.where(np.isnan(correlation[:, 1]), np.nan, size / time)
    constant = draws.max(axis=(1, 2)) - draws.min(axis=(1, 2)) < np.finfo(float).resolution
    return np.where(constant, float(size), ess)


def _correlation_time(correlation: Float[np.ndarray, "quantities lags"]) -> Float[np.ndarray, " quantities"]:
    """Return the integrated autocorrelation time: neighbouring lags in pairs, up to the first pair not positive."""
    rows, lags = np.arange(len(correlation)), correlation.shape[1]
    pairs = max(1, (lags - 3) // 2 + 1)
    even, odd = correlation[:, : 2 * pairs : 2], correlation[:, 1 : 2 * pairs : 2]
    both = even + odd
    ended = ~(both > 0.0)
    ended[:, -1] = True
    last = np.argmax(ended, axis=1)
    before = np.arange(pairs) < last[:, None]
    sums = np.where(before, np.minimum.accumulate(both, axis=1), 0.0).sum(axis=1)
    # Half of the last pair counts where it is positive, or its pair is.
    rest = np.where((both[rows, last] >= 0.0) | (even[rows, last] > 0.0), even[rows, last], 0.0)
    return 2.0 * sums - 1.0 + rest
