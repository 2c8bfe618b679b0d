"""How far summaries of the records put the posterior of what these share off."""

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import ArrayLike, Float

from bayes_tyre.inference.model.collapsed.model import SUMMARY_ERROR

#: Attribute of a posterior's tree with a `SummaryError`, as JSON, where records were integrated out by summaries.
RECORD_SUMMARIES = "record_summaries"
#: Largest `SummaryError.at_least` at which draws are kept. No mean of anything moves by more than so many of its
#: posterior standard deviations (Cauchy and Schwarz), the Monte Carlo error of 400 effective draws.
SUMMARY_ERROR_MOST = 0.05
#: The same after the pilot run, whose summaries are not about the posterior yet.
PILOT_ERROR_MOST = 1.0
#: Largest share of the variance that unknowns explain by chance at which draws say how much they explain.
_MOST_BY_CHANCE = 0.2


class SummaryError(NamedTuple):
    """How far summaries put the log density of what records share off: its standard deviation over the posterior.

    Attributes
    ----------
    total, at_least:
        Of all records together; and what it is at least, by two standard errors of what it is found by.
    case, of_case:
        Label of the case whose records are off most, and by how much, by the regression.
    chance:
        Standard error of the square of `total`; infinite where draws are too few to tell.
    """

    total: float
    at_least: float
    case: str
    of_case: float
    chance: float = 0.0

    def by_slopes(
        self, slopes: Float[np.ndarray, "draws unknowns"], points: Float[np.ndarray, "points unknowns"]
    ) -> "SummaryError":
        """Return it with the total that slopes of what the summaries miss say, which know it far better.

        What is linear in the unknowns, that is; `at_least` stays where the regression can tell and knows of more.

        Parameters
        ----------
        slopes:
            Along the unknowns, at draws of the posterior, each with records of its own.
        points:
            Draws of the unknowns.
        """
        if not np.isfinite(slopes).all():
            return self._replace(total=np.inf, at_least=np.inf, chance=np.inf)
        draws = len(slopes)
        # Times a root of the covariance of the points; any will do.
        whitened = slopes @ (points - points.mean(axis=0)).T / np.sqrt(len(points) - 1)
        mean, off = whitened.mean(axis=0), whitened - whitened.mean(axis=0)
        by_chance = np.sum(off**2) / (draws * (draws - 1))
        square = np.sum(mean**2) - by_chance
        products = off @ off.T / (draws * (draws - 1))
        chance = np.sqrt(2.0 * np.sum(products**2) + 4.0 * np.sum((off @ mean) ** 2) / (draws * (draws - 1)))
        total, at_least = (float(np.sqrt(max(each, 0.0))) for each in (square, square - 2.0 * chance))
        least = self.at_least if np.isfinite(self.chance) else 0.0
        return self._replace(total=total, at_least=max(at_least, least), chance=float(chance))

    def to_json(self) -> str:
        """Return it as a posterior's tree carries it in `RECORD_SUMMARIES`."""
        return json.dumps(self._asdict())

    @classmethod
    def from_json(cls, text: str) -> "SummaryError":
        """Return what `to_json` was called on."""
        return cls(**json.loads(text))


def summary_error(
    sites: Mapping[str, np.ndarray], sampled: Sequence[str], cases: Sequence[str], by_slopes: ArrayLike = 0.0
) -> SummaryError:
    """Return how far the summaries are off, by what a regression on the sampled sites explains of what they miss.

    What a draw of the records misses beyond that belongs to the draw, not to what the records share. The share that so
    many unknowns explain of anything by chance is taken off (adjusted R^2).

    Parameters
    ----------
    sites:
        Draws by site, shape (chains, draws, ...).
    sampled:
        Names of those that were sampled.
    cases:
        Labels of the cases.
    by_slopes:
        What of it, of all cases together, is in the log density already; shape (draws of all chains,).
    """
    missed = flat(sites[SUMMARY_ERROR])
    if not np.isfinite(missed).all():
        return SummaryError(np.inf, np.inf, cases[int(np.argmin(np.isfinite(missed).all(axis=0)))], np.inf)
    unknowns = [flat(sites[name]).reshape(len(missed), -1) for name in sampled]
    explained, chance = _explained(unknowns, np.column_stack([missed.sum(axis=1) - by_slopes, missed]))
    beyond = 2.0 * chance[0] if np.isfinite(chance[0]) else 0.0
    total, at_least, *of_case = np.sqrt(np.maximum([explained[0], explained[0] - beyond, *explained[1:]], 0.0))
    case = int(np.argmax(of_case))
    return SummaryError(float(total), float(at_least), cases[case], float(of_case[case]), float(chance[0]))


def _explained(
    sites: Sequence[Float[np.ndarray, "draws _"]], values: Float[np.ndarray, "draws values"]
) -> tuple[Float[np.ndarray, " values"], Float[np.ndarray, " values"]]:
    """Return the variance that the unknowns of some sites explain of each value, and its standard error by chance.

    Sites are regressed on together, the shortest first, as far as there are two draws for each unknown. Unknowns of
    longer ones, such as the effects of hundreds of levels, are coordinates with nothing to do with each other: what one
    of them explains adds to what the others do. Where draws are too few to tell, or miss so much by themselves that
    nothing can be told, it is all of the variance, and the standard error is infinite.
    """
    draws, variance = len(values), values.var(axis=0)
    together, singly, count = [np.ones((draws, 1))], [np.zeros((draws, 0))], 1
    for site in sorted(sites, key=lambda site: site.shape[1]):
        fits = 2 * (count + site.shape[1]) < draws
        (together if fits else singly).append(site - site.mean(axis=0))
        count += site.shape[1] * fits
    directions = np.linalg.qr(np.concatenate(together, axis=1)).Q

    def rest(of_all: Float[np.ndarray, "draws _"]) -> Float[np.ndarray, "draws _"]:
        return of_all - directions @ (directions.T @ of_all)

    residual, others = rest(values), rest(np.concatenate(singly, axis=1))
    others = others / np.maximum(others.std(axis=0), np.finfo(float).tiny)
    left = np.sum(residual**2, axis=0) / max(draws - count, 1)
    # Their squared covariances, less those of what nothing explains.
    singly_explained = np.sum((others.T @ residual) ** 2, axis=0) - np.sum(others**2) * left
    explained = variance - left + singly_explained / (draws * max(draws - count, 1))
    chance = left * np.sqrt(2.0 * (count + others.shape[1])) / draws
    measurable = (_MOST_BY_CHANCE * left >= chance) & (2.0 * chance <= PILOT_ERROR_MOST**2)
    return np.where(measurable, explained, variance), np.where(measurable, chance, np.inf)


def flat(values: np.ndarray) -> np.ndarray:
    """Return draws one after the other, whatever their chain."""
    return values.reshape(-1, *values.shape[2:])
