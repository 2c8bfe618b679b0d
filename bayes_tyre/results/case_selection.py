"""Which cases of a posterior are meant: by label or by words, with the opposite direction beside them."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.record import CASE_FACTORS, DIRECTIONS, TEXT_COLUMNS, Case

LISTED = 6


class Wish(NamedTuple):
    """What was asked for.

    Attributes
    ----------
    labels:
        Labels as posterior and figures print them, with the configuration in front or without.
    factor_table:
        The values asked for by word; a case has to match every word, and any of its values.
    """

    labels: tuple[str, ...]
    factor_table: Mapping[str, tuple[str | float, ...]]


class Choice(NamedTuple):
    """The cases chosen: their indices, loading before unloading, and those that have no opposite direction."""

    cases: tuple[int, ...]
    alone: tuple[int, ...]


def sign_of(case: Case) -> int:
    """Return 1 for loading, -1 for unloading, 0 where neither direction nor step says which."""
    if case.direction in DIRECTIONS:
        return 1 if case.direction == "loading" else -1
    return 0 if case.step_kN is None or math.isnan(case.step_kN) else int(math.copysign(1, case.step_kN))


def shown(label: str) -> str:
    """Return a label from a file as one short line, with escapes for what a terminal would not print."""
    line = " ".join(label.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line)[:60]


def listed(labels: Sequence[str]) -> str:
    """Return labels as a list of at most `LISTED`, and how many more there are."""
    more = f" and {len(labels) - LISTED} more" if len(labels) > LISTED else ""
    return ", ".join(map(shown, labels[:LISTED])) + more


def _labels(case: Case) -> tuple[str, str]:
    return case.label, case._replace(configuration="").label


def parse_wish(texts: Sequence[str], cases: Sequence[Case]) -> Wish:
    """Return what texts such as ``single (0)30-20`` or ``configuration=single,speed_km_h=0`` ask for.

    Parameters
    ----------
    texts:
        Each a label, or NAME=VALUE, several of them separated by commas. Words add up over texts: a case has to
        match them all; of one word given twice it has to match either value.
    cases:
        Those that there are: their labels are known as labels, whatever characters they hold.

    Raises
    ------
    BadInput
        For a name that is no word, a value that the word cannot have, and labels and words side by side.
    """
    known = {label for case in cases for label in _labels(case)}
    labels: list[str] = []
    factor_table: dict[str, tuple[str | float, ...]] = {}
    for text in (text.strip() for text in texts):
        if text in known or not re.match(r"\w+\s*=", text):
            labels.append(text)
            continue
        for part in re.split(r",(?=\s*\w+\s*=)", text):
            name, _, value = (piece.strip() for piece in part.partition("="))
            factor_table[name] = (*factor_table.get(name, ()), _value(name, value))
    if labels and factor_table:
        raise BadInput("labels and NAME=VALUE stand side by side; give one or the other")
    return Wish(tuple(labels), factor_table)


def _value(name: str, text: str) -> str | float:
    if name not in CASE_FACTORS:
        raise BadInput(f"{shown(name)!r} is no word of a case; use {', '.join(CASE_FACTORS)}")
    if name == "direction" and text not in DIRECTIONS:
        raise BadInput(f"direction={shown(text)}; use {' or '.join(DIRECTIONS)}")
    if name in TEXT_COLUMNS:
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"{name}={shown(text)} is no finite number; give one such as {name}=10")
    return number


def _same(one: object, other: object) -> bool:
    if isinstance(one, float | int) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=1e-9)  # 30.1 - 20.1 is not 10 in binary
    return one == other


def _matches(wish: Wish, case: Case) -> bool:
    if wish.labels:
        return any(label in wish.labels for label in _labels(case))
    return all(any(_same(getattr(case, name), value) for value in values) for name, values in wish.factor_table.items())


def _opposite(one: Case, other: Case) -> bool:
    """Return whether two cases are the same step from the same load, one up and one down."""
    size, size_of_other = (None if case.step_kN is None else abs(case.step_kN) for case in (one, other))
    alike = all(_same(getattr(one, name), getattr(other, name)) for name in ("configuration", *CASE_FACTORS[2:4]))
    return alike and _same(size, size_of_other) and sign_of(one) * sign_of(other) == -1


def choose(wish: Wish, cases: Sequence[Case]) -> Choice:
    """Return the cases that match, and with each its opposite: same words, a step of the same size the other way.

    Only the word `direction` keeps the opposite out: a label and a signed `step_kN` name a case, and who asks for
    a case wants to see it loading and unloading.

    Raises
    ------
    BadInput
        If no case matches.
    """
    matching = [i for i, case in enumerate(cases) if _matches(wish, case)]
    missed = [label for label in wish.labels if not any(label in _labels(case) for case in cases)]
    if missed or not matching:
        asked = missed or [f"{name}={value}" for name, values in wish.factor_table.items() for value in values]
        raise BadInput(
            f"no case matches {listed(asked)}; there are {len(cases)}: {listed([case.label for case in cases])}; "
            "name one of them, or words such as configuration=LABEL,speed_km_h=0"
        )
    opposite = {i: [j for j, other in enumerate(cases) if _opposite(cases[i], other)] for i in matching}
    if "direction" in wish.factor_table:
        return Choice(tuple(matching), ())
    chosen: list[int] = []
    for i in matching:
        both = sorted((i, *opposite[i]), key=lambda j: -sign_of(cases[j]))
        chosen += [j for j in both if j not in chosen]
    return Choice(tuple(chosen), tuple(i for i in matching if sign_of(cases[i]) and not opposite[i]))
