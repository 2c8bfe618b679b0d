"""Ratios between cases: configurations against each other, loading against unloading, matched case by case."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Bool

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.datatree import case_parameters, draws_in_a_row, tree_cases
from bayes_tyre.plain_text import listed, quoted
from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.results.equal_tailed import median_lower_upper

COLUMNS = (
    *("contrast", "matching", *CASE_FACTORS, "parameter"),
    *("median", "lower", "upper", "interval", "p_greater_than_1", "origin", "verdict"),
)
DIRECTIONS, SAME_CASE = "loading / unloading", "same case"
#: Where a posterior of the source's printed tables says that its data come from.
PUBLISHED = "published"
#: The entry of a posterior's `attrs` that names the configuration below in each of its ratios, where one was chosen.
REFERENCE = "reference"


class Pair(NamedTuple):
    """Indices of two cases whose ratio is taken, first over second, and the factors that both share."""

    first: int
    second: int
    shared: dict[str, object]


class _Contrast(NamedTuple):
    """A ratio of averages: which pairs (or, pooled, which cases), and the factors that its row shows."""

    contrast: str
    matching: str
    factors: dict[str, object]
    ratio: Callable[[np.ndarray], np.ndarray]


def _averaged(pairs: list[Pair]) -> Callable[[np.ndarray], np.ndarray]:
    """Return the geometric mean of the pairs' ratios: no pair weighs more for being large or turned over."""
    first, second = [pair.first for pair in pairs], [pair.second for pair in pairs]
    return lambda draws: np.exp(np.mean(np.log(draws[:, first]) - np.log(draws[:, second]), axis=1))


def _rows(contrast: str, matching: str, pairs: list[Pair], by: str) -> Iterator[_Contrast]:
    """Yield the average over all pairs, one for each level of `by`, and one for each pair; nothing without pairs."""
    if not pairs:
        return
    yield _Contrast(contrast, matching, {}, _averaged(pairs))
    for level in dict.fromkeys(pair.shared[by] for pair in pairs):
        yield _Contrast(contrast, matching, {by: level}, _averaged([p for p in pairs if p.shared[by] == level]))
    for pair in pairs:
        yield _Contrast(contrast, matching, pair.shared, _averaged([pair]))


def configuration_pairs(cases: Sequence[Case], above: str, below: str) -> list[Pair]:
    """Return the cases that two configurations share: same direction, speed, load and step."""
    index, pairs = {case: i for i, case in enumerate(cases)}, []
    for case in cases:
        other = case._replace(configuration=below)
        if case.configuration == above and other in index:
            shared = {factor: value for factor, value in case._asdict().items() if factor != "configuration"}
            pairs.append(Pair(index[case], index[other], shared))
    return pairs


def _configurations(cases: list[Case]) -> Iterator[_Contrast]:
    """Yield every pair of configurations, the earlier in sorted order above the later, over the cases of both."""
    for above, below in combinations(sorted({case.configuration for case in cases}), 2):
        yield from _rows(f"{above} / {below}", SAME_CASE, configuration_pairs(cases, above, below), by="direction")


def _same_span(case: Case) -> Case:
    end = round(case.initial_load_kN + case.step_kN, 9)  # 10.1 + 3.3 is not 13.4 in binary
    return case._replace(direction="unloading", initial_load_kN=end, step_kN=-case.step_kN)


def _same_initial_load(case: Case) -> Case:
    return case._replace(direction="unloading", step_kN=-case.step_kN)


#: How loading is matched with unloading, and the unloading case that a loading one has so.
MATCHINGS = {"same span": _same_span, "same initial load": _same_initial_load}


def direction_pairs(cases: Sequence[Case], matching: str) -> list[Pair]:
    """Return the loading cases that have an unloading one by a matching of `MATCHINGS`, with it."""
    index, partner, pairs = {case: i for i, case in enumerate(cases)}, MATCHINGS[matching], []
    for case in cases:
        given = case.initial_load_kN is not None and case.step_kN is not None
        if case.direction == "loading" and given and partner(case) in index:
            shared = {factor: value for factor, value in case._asdict().items() if factor != "direction"}
            pairs.append(Pair(index[case], index[partner(case)], shared))
    return pairs


def _directions(cases: list[Case]) -> Iterator[_Contrast]:
    """Yield loading over unloading, matched in two ways that disagree."""
    for matching in MATCHINGS:
        yield from _rows(DIRECTIONS, matching, direction_pairs(cases, matching), by="configuration")


def _as_published(cases: list[Case]) -> Iterator[_Contrast]:
    """Yield loading over unloading of each configuration, pooled over unlike cases as the source did."""
    for configuration in dict.fromkeys(case.configuration for case in cases):
        directions = [case.direction if case.configuration == configuration else "" for case in cases]
        up, down = ([i for i, d in enumerate(directions) if d == way] for way in ("loading", "unloading"))
        if up and down:
            yield _Contrast(DIRECTIONS, "pooled as published", {"configuration": configuration}, _pooled(up, down))


def _pooled(first: list[int], second: list[int]) -> Callable[[np.ndarray], np.ndarray]:
    """Return the ratio of arithmetic means over unlike cases: the source's comparison, which mixes speeds."""
    return lambda draws: draws[:, first].mean(axis=1) / draws[:, second].mean(axis=1)


def contrasts(tree: xr.DataTree, verdict: str, interval: float = 0.95) -> pd.DataFrame:
    """Return `contrasts.csv`: each ratio of k, beta or what else cases have: median, interval and P(ratio > 1).

    Parameters
    ----------
    tree:
        A posterior with `k_case` and `beta_case`.
    verdict:
        ``pass`` or ``fail``, written into every row.
    interval:
        Probability inside `lower` and `upper`, equal-tailed.

    Returns
    -------
    pandas.DataFrame
        `COLUMNS`; the factors of a row are those held fixed (empty where averaged over). Where loading is matched
        with unloading, `initial_load_kN` and `step_kN` are those of the loading case. `same span` swaps the two
        loads (20-30 with 30-20), `same initial load` starts from one load (20-30 with 20-10). `p_greater_than_1` is
        (count + 1/2) / (draws + 1), with the number of draws whose ratio is above 1 as the count: never 0 or 1.
    """
    posterior = tree["posterior"].to_dataset()
    cases = tree_cases(posterior)
    rows = []
    for contrast in _contrasts(tree, cases):
        for parameter in case_parameters(posterior):
            draws = draws_in_a_row(posterior[f"{parameter}_case"])
            ratio = contrast.ratio(draws)
            median, lower, upper = median_lower_upper(ratio, interval)
            rows.append(
                {
                    **{"contrast": contrast.contrast, "matching": contrast.matching, **_given(contrast.factors)},
                    **{"parameter": parameter, "median": median, "lower": lower, "upper": upper, "interval": interval},
                    **{
                        "p_greater_than_1": probability_of(ratio > 1.0),
                        "origin": tree.attrs["origin"],
                        "verdict": verdict,
                    },
                }
            )
    # Where a factor is missing, an average over one of its levels is the average over all, and is shown once.
    return pd.DataFrame(rows, columns=list(COLUMNS)).drop_duplicates(
        ["contrast", "matching", *CASE_FACTORS, "parameter"], ignore_index=True
    )


def _contrasts(tree: xr.DataTree, cases: list[Case]) -> Iterator[_Contrast]:
    yield from _configurations(cases)
    yield from _directions(cases)
    # Pooled contrasts compare unlike cases: they belong beside the source's own, where its tables are fitted.
    if tree.attrs["origin"] == PUBLISHED:
        yield from _as_published(cases)


def average_ratios(tree: xr.DataTree, parameter: str) -> xr.DataArray:
    """Return draws of the ratios of a parameter that are averaged over all matched cases; dims chain, draw, contrast.

    Labels are those of `contrasts.csv`: ``dual / single, same case``.
    """
    posterior = tree["posterior"].to_dataset()
    cases = tree_cases(posterior)
    of_case = posterior[f"{parameter}_case"].transpose("chain", "draw", "case").to_numpy()
    averages = {
        f"{one.contrast}, {one.matching}": one.ratio(of_case.reshape(-1, len(cases))).reshape(of_case.shape[:2])
        for one in _contrasts(tree, cases)
        if not one.factors
    }
    values = np.stack([*averages.values()], axis=-1) if averages else np.zeros((*of_case.shape[:2], 0))
    coordinates = {"chain": posterior["chain"], "draw": posterior["draw"], "contrast": [*averages]}
    return xr.DataArray(values, coordinates, ("chain", "draw", "contrast"))


def check_reference(reference: str, configurations: Iterable[str]) -> None:
    """Refuse a reference that is no configuration of the data.

    Raises
    ------
    BadInput
        The message lists the configurations.
    """
    if reference not in (labels := sorted(set(configurations))):
        there = listed([quoted(each) for each in labels if each], 10) or "none"
        raise BadInput(f"--reference {quoted(reference)}: no such configuration; the data have {there}")


def with_reference(table: pd.DataFrame, reference: str, configurations: Iterable[str]) -> pd.DataFrame:
    """Return contrasts with a configuration below in every ratio between it and another.

    An equal-tailed interval turns with its ratio, and so does P(ratio > 1). Other rows stay as they are.

    Parameters
    ----------
    table:
        As `contrasts` returns them.
    reference, configurations:
        The configuration, and all that the data have.
    """
    names = {f"{reference} / {other}": f"{other} / {reference}" for other in configurations if other != reference}
    turned = (table["matching"] == SAME_CASE) & table["contrast"].isin(list(names))
    rows, result = table[turned], table.copy()
    ratios = {"median": 1.0 / rows["median"], "lower": 1.0 / rows["upper"], "upper": 1.0 / rows["lower"]}
    new = {**ratios, "contrast": rows["contrast"].map(names), "p_greater_than_1": 1.0 - rows["p_greater_than_1"]}
    for column, values in new.items():
        result.loc[turned, column] = values
    return result


def probability_of(holds: Bool[np.ndarray, "..."]) -> float:
    """Return the probability of what holds in some draws: (count + 1/2) / (draws + 1), the mean under Jeffreys' prior.

    Draws in which all hold do not show that the probability is 1, only that it is about 1 - 1 / (2 draws) or more.
    """
    return float((np.count_nonzero(holds) + 0.5) / (holds.size + 1.0))


def _given(factors: dict[str, object]) -> dict[str, object]:
    return {factor: value for factor, value in factors.items() if value not in (None, "")}
