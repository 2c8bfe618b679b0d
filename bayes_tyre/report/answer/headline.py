"""The headline of a result in two sentences: which is stiffer, how sure; loading against unloading, or losses."""

import math

from bayes_tyre.report.answer.formatting import interval_name, label, percent_apart, probability, ratio_text, rounded
from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.answer.losses import losses_answer, of_group
from bayes_tyre.report.answer.ratios import (
    SAME_LOAD,
    SAME_SPAN,
    Ratio,
    between_configurations,
    between_directions,
    matched_cases,
)
from bayes_tyre.results.columns import numbers

#: The parameter that "stiffer" is about.
STIFFNESS = "k"
#: What says something of a mean that the data alone do not decide.
DECIDED = {
    "prior": "is decided by the prior, not by the data",
    "unclear": "is hardly decided by the data",
    "both": "depends on the prior too",
}
_MATCHED = {SAME_SPAN: "over the same span of load", SAME_LOAD: "from the same initial load"}
_FAILED = "Not to be relied on, for the fit failed its checks: "


def headline(result: Reported) -> tuple[str, str]:
    """Return the two sentences, plain text; hedged where the data do not tell, and where the verdict is fail."""
    alone = f"; no configuration is there to compare with {label(result.reference)}" if result.reference else ""
    first = _comparison(result) if len(result.configurations) > 1 else f"{_levels(result)}{alone}."
    if clause := prior_clause(result):
        first = f"{first.removesuffix('.')}; but {clause}."
    second = losses_answer(result) if result.of_motions else _directions(result)
    return _FAILED + small(first) if result.verdict == "fail" else first, second


def prior_clause(result: Reported, parameter: str = STIFFNESS) -> str:
    """Return which means of a parameter the data alone do not decide; nothing where they decide all."""
    rows = result.means(parameter)
    clauses = [
        f"{parameter} of {of_group(row)} {DECIDED[row['decided_by']]}"
        for _, row in rows[rows["decided_by"].isin(list(DECIDED))].iterrows()
    ]
    return ", ".join(clauses[:2]) + (f", and {len(clauses) - 2} more likewise" if len(clauses) > 2 else "")


def comparison_of(ratio: Ratio, over: str) -> str:
    """Return a sentence on one ratio of stiffness, in the direction of its table; no claim if its interval contains 1.

    `over` says which cases it averages.
    """
    size, times = interval_name(ratio.interval), ratio_text(ratio.median)
    above, below = label(ratio.above), label(ratio.below)
    reach = f"{ratio_text(ratio.lower)} to {ratio_text(ratio.upper)}"
    if not ratio.clear:
        return (
            f"These data do not tell which of {above} and {below} is stiffer: their ratio of {STIFFNESS}, {over}, is "
            f"{times}, its {size} of {reach} contains 1 (no difference), and the probability that {above} is the "
            f"stiffer is {probability(ratio.p_greater_than_1)}."
        )
    way, p = ("stiffer", ratio.p_greater_than_1) if ratio.median > 1.0 else ("softer", 1.0 - ratio.p_greater_than_1)
    how = (
        f"{percent_apart(ratio.median)} {way} than {below}, {over} (ratio of {STIFFNESS} {times}, {size}"
        if 0.5 < ratio.median < 2.0
        else f"{times} times as stiff as {below}, {over} ({size}"
    )
    return f"Configuration {above} is {how} {reach}; the probability that it is {way} at all is {probability(p)})."


def _comparison(result: Reported) -> str:
    pairs = list(between_configurations(result, STIFFNESS))
    pairs = [ratio for ratio in pairs if result.reference in ("", ratio.above, ratio.below)]
    count = len(result.configurations)
    if not pairs:
        which = f"The {count} configurations have" if not result.reference else f"{label(result.reference)} has"
        return f"{which} no test case in common, so none is compared; {small(_levels(result))}."
    widest = max(pairs, key=lambda ratio: abs(math.log(ratio.median)))
    shared = matched_cases(result, widest.above, widest.below)
    over = f"averaged over the {shared} test cases of both" if shared > 1 else "in the one test case of both"
    which = f"Two of {count} configurations are farthest apart: " if count > 2 and not result.reference else ""
    if count > 2 and result.reference:
        which = f"Of {count} configurations one is farthest from {label(result.reference)}: "
    comparison = comparison_of(widest, over)
    return f"{which}{small(comparison)}" if which else comparison


def small(sentence: str) -> str:
    """Return a sentence with a small first letter, to follow another."""
    return sentence[0].lower() + sentence[1:]


def _levels(result: Reported) -> str:
    """Return the stiffness of each configuration and direction, a clause."""
    rows = result.means(STIFFNESS)
    if rows.empty:
        return f"This result holds no mean stiffness {STIFFNESS}"
    size = interval_name(result.interval)
    means = [
        f"{rounded(row['median'])} {label(row['unit'])} for {of_group(row)} ({size} {rounded(row['lower'])} to "
        f"{rounded(row['upper'])})"
        for _, row in rows.iterrows()
    ]
    cases = len(result.cases[result.cases["parameter"] == STIFFNESS])
    over = f", averaged over its {cases} test cases" if cases > len(rows) else ""
    return f"The stiffness {STIFFNESS} is {', '.join(means)}{over}"


def _directions(result: Reported) -> str:
    directions = sorted(set(result.cases["direction"]))
    if directions == [""]:
        return "The records do not say which steps were loading, so loading and unloading are not compared."
    if len(directions) == 1:
        other = "unloading" if directions[0] == "loading" else "loading"
        return f"All steps are {label(directions[0])}, so {other} cannot be compared."
    ratios = between_directions(result, STIFFNESS)
    if not ratios and numbers(result.cases, "initial_load_kN").isna().all():
        return "The records do not say from which load they start, so loading and unloading are not compared."
    if not ratios:
        return "Loading and unloading have neither a span of load nor an initial load in common: they are not compared."
    sentences = [f"{_MATCHED[matching]}, {_loading(ratio)}" for matching, ratio in ratios.items()]
    return f"Loading against unloading: {'; '.join(sentences)}."


def _loading(ratio: Ratio) -> str:
    reach = f"{interval_name(ratio.interval)} {ratio_text(ratio.lower)} to {ratio_text(ratio.upper)}"
    if not ratio.clear:
        return f"the data do not tell which is stiffer (ratio {ratio_text(ratio.median)}, {reach}, which contains 1)"
    way = "stiffer" if ratio.median > 1.0 else "softer"
    return f"loading is {percent_apart(ratio.median)} {way} (ratio {ratio_text(ratio.median)}, {reach})"
