"""Ranks by chain: whether each chain goes through the same values as the others, and the band if it does."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.stats import binom, rankdata

from bayes_tyre.inference.sampling.effective_sizes import statistics
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter

#: Probability that all chains of a parameter stay within the band where they agree.
BAND = 0.95
#: Probability that no more parameters leave their band than are called chance, were they independent.
ALLOWED = 0.99
#: Points of a curve; draws a chain that thinning leaves at least; sets of uniform ranks that a band is found from.
POINTS, LEAST, SETS = 50, 50, 1000
#: The band hardly depends on the number of draws beyond this many of all chains.
_MANY = 1000


class Ranks(NamedTuple):
    """How the ranks of a parameter's draws are shared out among its chains.

    Attributes
    ----------
    name:
        The parameter's.
    at:
        Shape (points,): ranks as a share of all, from 0 to 1.
    excess:
        Shape (chains, points): share of a chain's draws that rank up to `at`, less the `at` to be expected.
    band:
        Shape (points,): all chains stay within +- this with probability `BAND` where they agree.
    """

    name: str
    at: Float[np.ndarray, " points"]
    excess: Float[np.ndarray, "chains points"]
    band: Float[np.ndarray, " points"]

    @property
    def leaves(self) -> bool:
        """Whether any chain leaves the band."""
        return bool(np.any(np.abs(self.excess) > self.band + 1e-12))


def in_words(all_ranks: Sequence[Ranks]) -> str:
    """Return how many parameters leave their band, and whether that is more than chance does where chains agree."""
    if not all_ranks:
        return ""
    count, of = sum(one.leaves for one in all_ranks), len(all_ranks)
    by_chance = int(binom.ppf(ALLOWED, of, 1.0 - BAND))
    sentence = f"{count} of {of} parameters leave{'s' * (count == 1)} the band"
    if count > by_chance:
        return f"Warning: {sentence}, more than the {by_chance} that may by chance: the chains do not agree."
    return f"{sentence}; up to {by_chance} may by chance."


def ranks(hyperparameter: Hyperparameter) -> Ranks:
    """Return the ranks of a population parameter, of draws thinned until they hardly depend on each other.

    One chain is held against itself, its first half against its second. The difference of a chain's cumulative
    share from the one expected shows what a histogram of ranks shows, without bins.

    Source: Vehtari et al. (2021), "Rank-normalization, folding, and localization"; the form with cumulative shares
    from Sailynoja, Burkner & Vehtari (2022), "Graphical test for discrete uniformity".
    """
    draws = hyperparameter.draws
    if len(draws) == 1:
        half = draws.shape[1] // 2
        draws = np.stack([draws[0, :half], draws[0, -half:]])
    thinned = draws[:, :: _apart(draws)]
    chains, per_chain = thinned.shape
    share = rankdata(thinned).reshape(thinned.shape) / thinned.size
    at = np.linspace(0.0, 1.0, POINTS + 1)
    below = np.stack([np.searchsorted(np.sort(chain), at + 1e-9) for chain in share]) / per_chain
    expected = np.floor(at * thinned.size + 1e-9) / thinned.size
    critical = _critical(chains, min(per_chain, max(20, _MANY // chains)))
    return Ranks(hyperparameter.name, at, below - expected, critical * _sd(at, chains, per_chain))


def _apart(draws: np.ndarray) -> int:
    """Return how many draws lie between two that tell as much as independent ones, by the worse of two ESS."""
    convergence = statistics(draws[:, :, None])
    ess = min(float(convergence.ess_bulk[0]), float(convergence.ess_tail[0]))
    most = max(1, draws.shape[1] // LEAST)
    return most if not ess > 0 else int(np.clip(np.ceil(draws.size / ess), 1, most))


def _sd(at: np.ndarray, chains: int, draws: int) -> np.ndarray:
    """Return the standard deviation of the excess where the ranks are dealt out to the chains at random."""
    return np.sqrt(at * (1.0 - at) / draws * (chains - 1) / (chains - 1.0 / draws))


@lru_cache(maxsize=64)
def _critical(chains: int, draws: int) -> float:
    """Return how many standard deviations hold the largest excess of all chains with probability `BAND`."""
    rng = np.random.default_rng(0)
    owner = rng.permuted(np.broadcast_to(np.arange(chains).repeat(draws), (SETS, chains * draws)), axis=1)
    upto = np.unique(np.floor(np.linspace(0.0, 1.0, POINTS + 1) * chains * draws + 1e-9).astype(int))
    upto = upto[(upto > 0) & (upto < chains * draws)]
    at = upto / (chains * draws)
    largest = np.zeros(SETS)
    for chain in range(chains):
        below = np.cumsum(owner == chain, axis=1)[:, upto - 1] / draws
        largest = np.maximum(largest, np.max(np.abs(below - at) / _sd(at, chains, draws), axis=1))
    return float(np.quantile(largest, BAND))
