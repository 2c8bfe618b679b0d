"""Which cases of a posterior are meant: by label or by factors, with the opposite direction beside them."""

import math
import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import NAME, escaped, listed, number_in
from bayes_tyre.record import CASE_FACTORS, DIRECTIONS, TEXT_COLUMNS, Case


class CaseQuery(NamedTuple):
    """What was asked for.

    Attributes
    ----------
    labels:
        Labels as posterior and figures print them, with the configuration in front or without.
    factor_values:
        The values asked for by factor; a case has to match every factor, and any of its values.
    """

    labels: tuple[str, ...]
    factor_values: Mapping[str, tuple[str | float, ...]]


class Choice(NamedTuple):
    """The cases chosen.

    Attributes
    ----------
    cases:
        Indices of those that there are, loading before unloading.
    alone:
        Indices of those that have no opposite direction.
    untested:
        Those without records: the factors asked for, in the place of those of cases with records.
    """

    cases: tuple[int, ...]
    alone: tuple[int, ...]
    untested: tuple[Case, ...] = ()


def sign_of(case: Case) -> int:
    """Return 1 for loading, -1 for unloading, 0 where neither direction nor step says which."""
    if case.direction in DIRECTIONS:
        return 1 if case.direction == "loading" else -1
    return 0 if case.step_kN is None or math.isnan(case.step_kN) else int(math.copysign(1, case.step_kN))


def case_list(labels: Sequence[str]) -> str:
    """Return labels as a short list for a message."""
    return listed(labels, show=_shown)


def _shown(label: str) -> str:
    return escaped(label)[:NAME]


def _labels(case: Case) -> tuple[str, str]:
    return case.label, case._replace(configuration="").label


def parse_query(texts: Sequence[str], cases: Sequence[Case]) -> CaseQuery:
    """Return what texts such as ``single (0)30-20`` or ``configuration=single,speed_km_h=0`` ask for.

    Parameters
    ----------
    texts:
        Each a label, or NAME=VALUE, several of them separated by commas. Factors add up over texts: a case has to
        match them all; of one factor given twice it has to match either value.
    cases:
        Those that there are: their labels are taken as labels, whatever characters they hold.

    Raises
    ------
    BadInput
        For a name that is no factor, a value that the factor cannot have, and labels beside factors.
    """
    existing = {label for case in cases for label in _labels(case)}
    labels: list[str] = []
    factor_values: dict[str, tuple[str | float, ...]] = {}
    for text in (text.strip() for text in texts):
        if text in existing or not re.match(r"\w+\s*=", text):
            labels.append(text)
            continue
        for part in re.split(r",(?=\s*\w+\s*=)", text):
            name, _, value = (piece.strip() for piece in part.partition("="))
            factor_values[name] = (*factor_values.get(name, ()), _value(name, value))
    if labels and factor_values:
        raise BadInput("labels and NAME=VALUE stand side by side; give one or the other")
    return CaseQuery(tuple(labels), factor_values)


def _value(name: str, text: str) -> str | float:
    if name not in CASE_FACTORS:
        raise BadInput(f"{_shown(name)!r} is no factor of a case; use {', '.join(CASE_FACTORS)}")
    if name == "direction" and text not in DIRECTIONS:
        raise BadInput(f"direction={_shown(text)}; use {' or '.join(DIRECTIONS)}")
    if name in TEXT_COLUMNS:
        return text
    number = number_in(text)
    if number is None or not math.isfinite(number):
        raise BadInput(f"{name}={_shown(text)} is no finite number; give one such as {name}=10")
    return number


def _same(one: object, other: object) -> bool:
    if isinstance(one, float | int) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=1e-9)  # 30.1 - 20.1 is not 10 in binary
    return one == other


def _matches(query: CaseQuery, case: Case) -> bool:
    if query.labels:
        return any(label in query.labels for label in _labels(case))
    return all(
        any(_same(getattr(case, name), value) for value in values) for name, values in query.factor_values.items()
    )


def _opposite(one: Case, other: Case) -> bool:
    """Return whether two cases are the same step from the same load, one up and one down."""
    size, size_of_other = (None if case.step_kN is None else abs(case.step_kN) for case in (one, other))
    alike = all(_same(getattr(one, name), getattr(other, name)) for name in ("configuration", *CASE_FACTORS[2:4]))
    return alike and _same(size, size_of_other) and sign_of(one) * sign_of(other) == -1


def matching_cases(query: CaseQuery, cases: Sequence[Case]) -> list[int]:
    """Return the indices of the cases that match.

    Raises
    ------
    BadInput
        If no case matches.
    """
    matching = [i for i, case in enumerate(cases) if _matches(query, case)]
    missed = [label for label in query.labels if not any(label in _labels(case) for case in cases)]
    if missed or not matching:
        asked = missed or [f"{name}={value}" for name, values in query.factor_values.items() for value in values]
        raise BadInput(
            f"no case matches {case_list(asked)}; there are {len(cases)}: {case_list([case.label for case in cases])}; "
            "name one of them, or factors such as configuration=LABEL,speed_km_h=0"
        )
    return matching


def without_opposites(query: CaseQuery, cases: Sequence[Case]) -> Choice:
    """Return the cases that match, and those without records that are asked for, by themselves.

    Raises
    ------
    BadInput
        If no case matches, and none can be made of the numbers asked for.
    """
    made = [] if query.labels else _made_cases(query, cases)
    if not made:
        return Choice(tuple(matching_cases(query, cases)), ())
    matching = [i for i, case in enumerate(cases) if _matches(query, case) or any(_alike(case, one) for one in made)]
    return Choice(tuple(matching), (), tuple(one for one in made if not any(_alike(one, case) for case in cases)))


def _made_cases(query: CaseQuery, cases: Sequence[Case]) -> list[Case]:
    """Return the cases that a query asks for by speeds, loads and steps that no case has together.

    Values for which there is a case ask for no other. All else is as in the cases that have the other factors: their
    configurations and directions, with a step of their sign, or of the direction asked for. The other direction of one
    that no case has may have records.
    """
    made: dict[Case, None] = {}
    for values in product(*query.factor_values.values()):
        asked = dict(zip(query.factor_values, values, strict=True))
        one = CaseQuery((), {name: (value,) for name, value in asked.items()})
        if not any(_matches(one, case) for case in cases):
            made |= dict.fromkeys(_made_of(asked, case) for case in _nearest(one, cases))
    return sorted((case for case in made if _possible(case, query)), key=_order)


def _order(case: Case) -> tuple[str, float, float, float]:
    """Return what cases are sorted by: loading before unloading."""
    return case.configuration or "", case.speed_km_h or 0.0, case.initial_load_kN or 0.0, -(case.step_kN or 0.0)


def _made_of(asked: Mapping[str, str | float], case: Case) -> Case:
    """Return a case with other numbers; of a step its size, for its sign is the direction's."""
    numbers = {name: float(value) for name, value in asked.items() if name not in TEXT_COLUMNS}
    if "step_kN" in numbers:
        numbers["step_kN"] = (sign_of(case) or 1) * abs(numbers["step_kN"])
    return case._replace(**numbers)


def _possible(case: Case, query: CaseQuery) -> bool:
    """Return whether a rig could do a step, and whether its sign is one asked for with its direction."""
    load, step = case.initial_load_kN, case.step_kN
    ends = 0.0 if load is None or step is None else load + step
    steps = query.factor_values.get("step_kN", ()) if "direction" in query.factor_values else ()
    numbers = [number for number in (case.speed_km_h, load, ends) if number is not None]
    return step != 0 and all(number >= 0 for number in numbers) and (not steps or step in steps)


def _alike(one: Case, other: Case) -> bool:
    return all(_same(a, b) for a, b in zip(one, other, strict=True))


def _nearest(query: CaseQuery, cases: Sequence[Case]) -> list[Case]:
    """Return the cases that match a query in its textual factors, and in as many numbers as any of their direction.

    A step is as good as one of its size the other way; a case without one of the numbers is none of them.
    """
    textual = {name: values for name, values in query.factor_values.items() if name in TEXT_COLUMNS}
    numbers = {name: values for name, values in query.factor_values.items() if name not in TEXT_COLUMNS}
    numbers |= {"step_kN": (*numbers["step_kN"], -float(*numbers["step_kN"]))} if "step_kN" in numbers else {}
    alike = [case for case in cases if _matches(CaseQuery((), textual), case)]
    alike = [case for case in alike if all(getattr(case, name) is not None for name in numbers)]
    shared = [sum(_matches(CaseQuery((), {name: numbers[name]}), case) for name in numbers) for case in alike]
    most: dict[tuple[str, str], int] = {}
    for case, count in zip(alike, shared, strict=True):
        most[case[:2]] = max(count, most.get(case[:2], 0))
    return [case for case, count in zip(alike, shared, strict=True) if count == most[case[:2]]]


def choose(query: CaseQuery, cases: Sequence[Case]) -> Choice:
    """Return the cases that match, and with each its opposite: same factors, a step of the same size the other way.

    Only the factor `direction` keeps the opposite out: a label and a signed `step_kN` name a case, and who asks for
    a case wants to see it loading and unloading.

    Raises
    ------
    BadInput
        If no case matches, and none can be made of the numbers asked for.
    """
    matching, _, untested = without_opposites(query, cases)
    opposite = {i: [j for j, other in enumerate(cases) if _opposite(cases[i], other)] for i in matching}
    if "direction" in query.factor_values:
        return Choice(matching, (), untested)
    chosen: list[int] = []
    for i in matching:
        both = sorted((i, *opposite[i]), key=lambda j: -sign_of(cases[j]))
        chosen += [j for j in both if j not in chosen]
    return Choice(tuple(chosen), tuple(i for i in matching if sign_of(cases[i]) and not opposite[i]), untested)


def without_opposite(untested: Sequence[Case], cases: Sequence[Case]) -> list[Case]:
    """Return the cases without records whose opposite direction is not asked for, nor has any."""
    both = (*untested, *cases)
    return [case for case in untested if sign_of(case) and not any(_opposite(case, other) for other in both)]
