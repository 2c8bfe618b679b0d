"""Tests of simulation-based calibration: uniform ranks, and coverage of intervals."""

from functools import lru_cache

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.stats import binom, binomtest

#: Probabilities inside the intervals whose coverage is counted.
INTERVALS = (0.5, 0.8, 0.95)
#: Probability that all parameters of a calibrated posterior stay inside their bands together.
TOGETHER = 0.95
#: Sets of uniform ranks that give the null distribution of the deviation.
NULL_SETS = 10_000
_SEED = 20_190_101


def ranks(
    truths: Float[np.ndarray, " sets"], draws: Float[np.ndarray, "sets draws"], rng: np.random.Generator
) -> Int[np.ndarray, " sets"]:
    """Return how many draws of each data set lie below its truth: uniform from 0 to the number of draws where the
    posterior is calibrated.

    Where draws equal the truth, its place among them is random.
    """
    below, same = np.sum(draws < truths[:, None], axis=1), np.sum(draws == truths[:, None], axis=1)
    return below + rng.integers(0, same + 1)


def pit(ranked: Int[np.ndarray, " sets"], draws: int, rng: np.random.Generator) -> Float[np.ndarray, " sets"]:
    """Return randomised ranks in (0, 1): uniform exactly where the ranks are."""
    return (ranked + rng.random(len(ranked))) / (draws + 1)


def deviation_p_value(values: Float[np.ndarray, " sets"]) -> float:
    """Return how probable it is that uniform values deviate as far from uniform as these, in (0, 1), do.

    The deviation is the least tail probability, over all points, of the share of values up to the point.

    Source: Sailynoja, Burkner & Vehtari (2022), "Graphical test for discrete uniformity and its applications in
    goodness-of-fit evaluation and multiple sample comparison", Statistics and Computing 32: their gamma.
    """
    null = _null(len(values))
    return float((1 + np.searchsorted(null, _gamma(values[None])[0], side="right")) / (1 + len(null)))


def band(sets: int, together: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points in (0, 1), and the simultaneous band of the empirical distribution less the uniform one there.

    Parameters
    ----------
    sets:
        Number of ranks.
    together:
        Probability that uniform ranks stay inside everywhere.
    """
    gamma = np.quantile(_null(sets), 1.0 - together)
    at = np.arange(1, sets) / sets
    return at, binom.ppf(gamma / 2, sets, at) / sets - at, binom.ppf(1 - gamma / 2, sets, at) / sets - at


def share_interval(inside: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share that was counted (exact binomial, Clopper-Pearson); NaN of none in all."""
    if not total:
        return np.nan, np.nan
    around = binomtest(inside, total).proportion_ci(0.95, method="exact")
    return float(around.low), float(around.high)


def coverage(ranked: Int[np.ndarray, " sets"], draws: int, interval: float) -> tuple[float, float, float]:
    """Return the share of truths inside the central interval, and the 95 % interval of that share.

    The interval lies between two draws. It holds its probability exactly where (draws + 1) (1 - interval) / 2 is a
    whole number: with 39, 79, 119, ... draws for 50, 80 and 95 %.
    """
    outside = (draws + 1) * (1.0 - interval) / 2.0
    inside = int(np.sum((ranked >= outside - 1e-9) & (ranked <= draws - outside + 1e-9)))
    return inside / len(ranked), *share_interval(inside, len(ranked))


def uniformity_table(by_parameter: dict[str, np.ndarray], draws: int, seed: int = 0) -> pd.DataFrame:
    """Return a row a parameter: coverage of each interval, p-value of uniform ranks, and whether it is `calibrated`.

    A parameter is not where its p-value is below (1 - TOGETHER) / parameters: all parameters of a right posterior are
    called calibrated together with a probability of at least TOGETHER.

    Parameters
    ----------
    by_parameter:
        Ranks, shape (sets,), from 0 to `draws`.
    draws:
        Draws that truths were ranked among.
    seed:
        Of the places within a rank.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for parameter, ranked in by_parameter.items():
        row: dict[str, object] = {"parameter": parameter, "datasets": len(ranked), "ranks": draws + 1}
        for interval in INTERVALS:
            name = f"coverage_{100 * interval:.0f}"
            row |= dict(zip((name, f"{name}_lower", f"{name}_upper"), coverage(ranked, draws, interval), strict=True))
        values = pit(ranked, draws, rng)
        row |= {"mean_rank": float(np.mean(values)), "p_value": deviation_p_value(values)}
        rows.append(row)
    table = pd.DataFrame(rows)
    return table.assign(calibrated=table["p_value"] >= (1.0 - TOGETHER) / len(table))


def _gamma(values: Float[np.ndarray, "many sets"]) -> Float[np.ndarray, " many"]:
    sets = values.shape[1]
    at = np.arange(1, sets) / sets
    ordered = np.sort(values, axis=1)
    counts = np.stack([np.searchsorted(row, at, side="right") for row in ordered])
    # Tabulated: the distribution of a count depends on the point alone.
    upto = binom.cdf(np.arange(-1, sets + 1)[:, None], sets, at)
    column = np.arange(sets - 1)
    tail = np.minimum(upto[counts + 1, column], 1.0 - upto[counts, column])
    return np.minimum(1.0, 2.0 * tail.min(axis=1))


@lru_cache(maxsize=8)
def _null(sets: int) -> np.ndarray:
    rng = np.random.default_rng(_SEED)
    return np.sort(np.concatenate([_gamma(rng.random((500, sets))) for _ in range(NULL_SETS // 500)]))
