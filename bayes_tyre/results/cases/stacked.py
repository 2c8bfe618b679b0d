"""Draws of cases by one model, or by several that predict together: of each as many as its weight is."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import law_of, priors_of
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import Case
from bayes_tyre.results.cases.draws import CaseDraws, CaseValues, of_repeat, tested, thinned
from bayes_tyre.results.cases.selection import Choice
from bayes_tyre.results.cases.untested import untested, untested_rng

#: The word before what is predicted of a case without records.
UNTESTED = "untested "


class Weighted(NamedTuple):
    """One of several models: its posterior of records, and the weight of what it predicts."""

    tree: xr.DataTree
    weight: float


class DrawnCase(NamedTuple):
    """What a model draws of a case: the word before what is predicted, and what noise is drawn with, beside it."""

    case: Case
    kind: str
    draws: CaseDraws
    law: str
    rng: np.random.Generator


def shares_of(models: Sequence[Weighted]) -> list[tuple[xr.DataTree, int]]:
    """Return the posterior of each model that has any weight, and how many of its draws are as many as its weight is.

    Raises
    ------
    BadInput
        If none has.
    """
    total = sum(model.weight for model in models)
    if not total > 0:
        raise BadInput("the weights of all models are 0; run compare again")
    weighted = [(tree, weight / total) for tree, weight in models if weight > 0]
    sizes = [with_records(tree).sizes for tree, _ in weighted]
    most = min(size["chain"] * size["draw"] / share for size, (_, share) in zip(sizes, weighted, strict=True))
    return [(tree, count) for tree, share in weighted if (count := round(share * most))]


def drawn_cases(tree: xr.DataTree, count: int, choice: Choice, of: str, seed: int) -> Iterator[DrawnCase]:
    """Yield the cases chosen, of each so many draws, evenly spaced, and random numbers of its own."""
    posterior, priors, law = with_records(tree), priors_of(tree), law_of(tree)
    for values, rng, kind in _chosen(posterior, choice, priors, seed):
        draws = values.mean() if of == "case" else of_repeat(posterior, values, rng, priors.discordant_widening)
        yield DrawnCase(values.case, kind, thinned(draws, count), law, rng)


def _chosen(
    posterior: xr.Dataset, choice: Choice, priors: Priors, seed: int
) -> Iterator[tuple[CaseValues, np.random.Generator, str]]:
    """Yield the cases chosen, each with random numbers of its own, and the word before what is predicted of it."""
    for i in choice.cases:
        yield tested(posterior, i), np.random.default_rng((seed, i)), ""
    for case in choice.untested:
        rng = untested_rng(posterior, seed)
        yield untested(posterior, priors, case, rng), rng, UNTESTED
