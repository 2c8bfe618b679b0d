"""What a posterior is to answer: the ratio of two configurations or directions, or the value of one case."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import quoted
from bayes_tyre.record import DIRECTIONS, ENERGY, Case
from bayes_tyre.results.cases.selection import case_list
from bayes_tyre.results.contrasts import MATCHINGS, Pair, configuration_pairs, direction_pairs


class Goal(NamedTuple):
    """A number to be known, whose logarithm is a weighted sum of the logarithms of cases' values.

    Attributes
    ----------
    text:
        As it was asked for, such as ``k dual / single``.
    parameter:
        Whose values the cases have.
    weights:
        Shape (cases,).
    of:
        What it is taken over, such as ``24 pairs of cases``.
    """

    text: str
    parameter: str
    weights: Float[np.ndarray, " cases"]
    of: str


def parse_goal(text: str, cases: Sequence[Case], with_records: int, parameters: Sequence[str]) -> Goal:
    """Return the goal that a text is, such as ``k dual / single``, ``beta loading / unloading``, ``k single (0)30-20``.

    A ratio is the geometric mean over the pairs of cases that match, as in `contrasts.csv`; loading is matched with
    unloading over the same span of load, or from the same initial load where no spans match.

    Parameters
    ----------
    text:
        A parameter, then two configurations or the two directions with a slash between, or the label of a case.
    cases, with_records:
        Cases, and how many of them have records: they come first, and a ratio is taken over them alone.
    parameters:
        Those that a case of the posterior has; another is refused as `BadInput`, like what is no ratio and no case.
    """
    parameter, _, asked = " ".join(text.split()).partition(" ")
    check_parameter(text, parameter, parameters)
    labels = [case.label for case in cases]
    if asked in labels:
        return Goal(text, parameter, np.eye(len(cases))[labels.index(asked)], "one case")
    parts = asked.split("/")  # a label may have a slash of its own
    for place in range(1, len(parts)):
        first, second = ("/".join(side).strip() for side in (parts[:place], parts[place:]))
        pairs, of = _pairs(first, second, cases[:with_records])
        if pairs and first != second:
            break
    else:
        configurations = sorted({case.configuration for case in cases})
        raise BadInput(
            f"--goal {quoted(text)}: is no case, and no ratio of configurations ({case_list(configurations)}) or of "
            f"directions with cases that match; cases are {case_list(labels)}"
        )
    goal = ratio_goal(text, parameter, pairs, len(cases), of)
    # Pairs of directions are loading over unloading.
    return goal._replace(weights=-goal.weights) if first == DIRECTIONS[1] else goal


def check_parameter(text: str, parameter: str, parameters: Sequence[str]) -> None:
    """Refuse, as `BadInput`, a goal on what no case of the posterior has."""
    if parameter not in parameters:
        where = "; energy is estimated from raw files: run bayes-tyre motion" if parameter == ENERGY else ""
        names = ", ".join(parameters)
        raise BadInput(f"--goal {quoted(text)}: no case has {quoted(parameter)} here; the posterior has {names}{where}")


def ratio_goal(text: str, parameter: str, pairs: Sequence[Pair], cases: int, of: str) -> Goal:
    """Return the geometric mean over pairs of the first case's value over the second's; `cases` in all."""
    weights = np.zeros(cases)
    for pair in pairs:
        weights[pair.first] += 1.0 / len(pairs)
        weights[pair.second] -= 1.0 / len(pairs)
    return Goal(text, parameter, weights, of)


def _pairs(first: str, second: str, cases: Sequence[Case]) -> tuple[list[Pair], str]:
    """Return the pairs of cases that a ratio is taken over, and in words."""
    if {first, second} != set(DIRECTIONS):
        pairs = configuration_pairs(cases, first, second)
        return pairs, f"{len(pairs)} pairs of cases"
    matched = {matching: direction_pairs(cases, matching) for matching in MATCHINGS}
    matching = next((name for name, pairs in matched.items() if pairs), "same span")
    return matched[matching], f"{len(matched[matching])} pairs of cases, {matching}"
