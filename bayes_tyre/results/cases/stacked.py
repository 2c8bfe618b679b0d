"""Draws of cases by one model, or by several that predict together: of each as many as its weight is."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import law_of, priors_of
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import Case
from bayes_tyre.results.cases.draws import (
    CaseDraws,
    CaseValues,
    evenly_spaced,
    of_repeat,
    parameters_of_case,
    tested,
    thinned,
)
from bayes_tyre.results.cases.selection import Choice
from bayes_tyre.results.cases.untested import untested, untested_rng

#: The word before what is predicted of a case without records.
UNTESTED = "untested "


class Weighted(NamedTuple):
    """One of several models: its posterior of records, and the weight of what it predicts."""

    tree: xr.DataTree
    weight: float


class Share(NamedTuple):
    """A model's posterior, and how many of its draws are as many as its weight is: of its records, and of its cases.

    They are fewer of records that were thinned (`bayes_tyre.inference.sampling.record_draws`).
    """

    tree: xr.DataTree
    of_records: int
    of_cases: int


class DrawnCase(NamedTuple):
    """What a model draws of a case: the word before what is predicted, and what noise is drawn with, beside it.

    `draws_of_case` are draws of k (kN/mm) and beta (mm) of a case that was tested: more of them than `draws` where its
    records were thinned. It is empty where they are no parameters of the case itself.
    """

    case: Case
    kind: str
    draws: CaseDraws
    draws_of_case: Mapping[str, Float[np.ndarray, " all"]]
    law: str
    rng: np.random.Generator


def shares_of(models: Sequence[Weighted]) -> list[Share]:
    """Return the share of each model that has any weight.

    Raises
    ------
    BadInput
        If none has.
    """
    total = sum(model.weight for model in models)
    if not total > 0:
        raise BadInput("the weights of all models are 0; run compare again")
    weighted = [(tree, weight / total) for tree, weight in models if weight > 0]
    weights = [weight for _, weight in weighted]
    of_records = _counts([with_records(tree) for tree, _ in weighted], weights)
    of_cases = _counts([tree["posterior"].to_dataset() for tree, _ in weighted], weights)
    shares = [Share(tree, *counts) for (tree, _), *counts in zip(weighted, of_records, of_cases, strict=True)]
    return [share for share in shares if share.of_records]


def _counts(posteriors: Sequence[xr.Dataset], weights: Sequence[float]) -> list[int]:
    """Return how many draws of each posterior are as many as its weight is, and most together."""
    sizes = [posterior.sizes["chain"] * posterior.sizes["draw"] for posterior in posteriors]
    most = min(size / weight for size, weight in zip(sizes, weights, strict=True))
    return [round(weight * most) for weight in weights]


def drawn_cases(share: Share, choice: Choice, of: str, seed: int) -> Iterator[DrawnCase]:
    """Yield the cases chosen, of each as many draws as the share has, evenly spaced, and random numbers of its own."""
    tree, law, widening = share.tree, law_of(share.tree), priors_of(share.tree).discordant_widening
    posterior, whole = with_records(tree), tree["posterior"].to_dataset()
    for number, values, rng in _chosen(posterior, choice, priors_of(tree), seed):
        draws = values.mean() if of == "case" else of_repeat(posterior, values, rng, widening)
        draws_of_case = parameters_of_case(whole, number) if number is not None and of == "case" else {}
        draws_of_case = {name: evenly_spaced(each, share.of_cases) for name, each in draws_of_case.items()}
        kind = UNTESTED if number is None else ""
        yield DrawnCase(values.case, kind, thinned(draws, share.of_records), draws_of_case, law, rng)


def _chosen(
    posterior: xr.Dataset, choice: Choice, priors: Priors, seed: int
) -> Iterator[tuple[int | None, CaseValues, np.random.Generator]]:
    """Yield the cases chosen, each with its number, None where it was not tested, and random numbers of its own."""
    for i in choice.cases:
        yield i, tested(posterior, i), np.random.default_rng((seed, i))
    for case in choice.untested:
        rng = untested_rng(posterior, seed)
        yield None, untested(posterior, priors, case, rng), rng
