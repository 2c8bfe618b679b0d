"""The tables of the document: a row a case, contrast or record; for each result and parameter a column."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import pandas as pd

from bayes_tyre.record import CASE_FACTORS, FACTORS, RING_DOWN_MM
from bayes_tyre.report.answer.formatting import given, label, rounded
from bayes_tyre.report.answer.load import LAW_NUMBERS, MEAN, Reported
from bayes_tyre.report.answer.losses import losses_tables
from bayes_tyre.report.wording import probability_text, text_name

#: What factors are called above a column, and their unit; whether they are numbers.
HEADINGS = {
    "record": ("record", "", False),
    "configuration": ("configuration", "", False),
    "direction": ("direction", "", False),
    "speed_km_h": ("speed", "km/h", True),
    "initial_load_kN": ("initial load", "kN", True),
    "step_kN": ("step", "kN", True),
    "repeat": ("repeat", "", True),
    "contrast": ("contrast", "", False),
    "matching": ("matched by", "", False),
    "law": ("force law", "", False),
}
#: What the numbers of `laws.csv` are called, and how they are shown.
_OF_LAWS: dict[str, tuple[str, Callable[[float], str]]] = {
    "weight": ("weight by all records", probability_text),
    "weight_by_record": ("mean weight by record", probability_text),
    "preferred": ("records that prefer it", given),
    "log_evidence_difference": ("log evidence less the best law's", rounded),
    "difference_se": ("standard error over records", rounded),
    "records": ("records in the sum", given),
}


class Cell(NamedTuple):
    """What stands in a cell.

    Attributes
    ----------
    text:
        As it is read; empty where there is nothing.
    value:
        What it sorts by, unrounded; empty where there is nothing.
    reach:
        The interval, as it is read.
    lower, upper:
        Its ends, unrounded.
    """

    text: str = ""
    value: str = ""
    reach: str = ""
    lower: str = ""
    upper: str = ""


class Column(NamedTuple):
    """What stands above a column: which result it is of (empty for one), a heading, a unit, and if it holds numbers."""

    of_result: str
    heading: str
    unit: str
    number: bool


class Table(NamedTuple):
    """A table of the document: its name in the page, what it is, its columns, and its rows of cells."""

    name: str
    caption: str
    columns: list[Column]
    rows: list[list[Cell]]


class _Measure(NamedTuple):
    """A column of numbers: what it is called, and the cell of a row."""

    heading: str
    unit: str
    cell: Callable[[pd.Series], Cell]


def means_table(results: Sequence[Reported]) -> Table:
    """Return the means over the cases of each configuration and direction."""
    tables = []
    for result in results:
        rows = result.summary[result.summary["parameter"].str.endswith(MEAN)]
        rows = rows.sort_values(
            "configuration", ascending=False, kind="stable"
        )  # as the tables of cases and the terminal
        tables.append(rows.assign(parameter=rows["parameter"].str.removesuffix(MEAN)))
    return _table("means", "Averages over the test cases", results, tables, CASE_FACTORS[:2], _values)


def cases_table(results: Sequence[Reported]) -> Table:
    """Return the parameters of each case."""
    caption = "Cases: the same test, whatever the repeat"
    return _table("cases", caption, results, [each.cases for each in results], CASE_FACTORS, _values)


def losses_table(results: Sequence[Reported]) -> Table:
    """Return what each case of motions loses beside the energy, and how stiff its cycles are."""
    caption = (
        "Losses and stiffness of each case: in a cycle of the energy's amplitude, free vibration in one of "
        f"{RING_DOWN_MM:g} mm; separation of branches and stiffness on flat ground"
    )
    return _table("losses", caption, results, losses_tables(results), CASE_FACTORS, _values)


def contrasts_table(results: Sequence[Reported]) -> Table:
    """Return the ratios of each parameter, each with its probability to be above 1."""
    caption = "Contrasts: ratios of matched cases; empty factors are averaged over"
    factor_names = ("contrast", "matching", *CASE_FACTORS)
    return _table("contrasts", caption, results, [each.contrasts for each in results], factor_names, _ratios)


def laws_table(results: Sequence[Reported]) -> Table:
    """Return the weights of force laws, of results that average over them."""
    nothing = pd.DataFrame({name: pd.Series(dtype=object) for name in ("configuration", "law", *LAW_NUMBERS)})
    tables = [(nothing if each.laws is None else each.laws).assign(parameter="law") for each in results]
    caption = "Force laws: how far the records of each configuration prefer them, one by one and together"
    return _table("laws", caption, results, tables, ("configuration", "law"), _weights)


def repeats_table(results: Sequence[Reported]) -> Table:
    """Return the parameters of each record, and the probability that it is an outlier, of results that judge it."""
    judged = [_judges(each.repeats) for each in results]
    caption = "Repeats: each record, and the probability that it does not agree with its repeats"
    if not any(judged):
        caption = "Repeats: each record (nothing here says whether one is discordant: see the glossary)"
    return _table("repeats", caption, results, [each.repeats for each in results], ("record", *FACTORS), _of_repeats)


def _values(parameter: str, rows: pd.DataFrame) -> list[_Measure]:
    return [_Measure(text_name(parameter), rows["unit"].iloc[0], _with_interval)]


def _ratios(parameter: str, _: pd.DataFrame) -> list[_Measure]:
    return [
        _Measure(f"ratio of {text_name(parameter)}", "", _with_interval),
        _Measure(f"P(> 1), {text_name(parameter)}", "", _only("p_greater_than_1")),
    ]


def _of_repeats(parameter: str, rows: pd.DataFrame) -> list[_Measure]:
    outlier = _Measure("outlier probability", "", _only("outlier_probability"))
    return [*([outlier] if rows.attrs["first"] == parameter and _judges(rows) else []), *_values(parameter, rows)]


def _weights(_: str, __: pd.DataFrame) -> list[_Measure]:
    return [_Measure(heading, "", _only(name, show)) for name, (heading, show) in _OF_LAWS.items()]


def _judges(repeats: pd.DataFrame) -> bool:
    """Return whether any record has an outlier probability: a column without one would say nothing."""
    return bool(repeats["outlier_probability"].notna().any())


def _only(column: str, show: Callable[[float], str] = probability_text) -> Callable[[pd.Series], Cell]:
    return lambda row: number(row[column], show)


def _with_interval(row: pd.Series) -> Cell:
    return with_reach(row["median"], row["lower"], row["upper"])


def with_reach(median: float, lower: float, upper: float) -> Cell:
    """Return a median's cell with its interval."""
    low, high = number(lower), number(upper)
    reach = f"{low.text}\N{NO-BREAK SPACE}to {high.text}" if low.text and high.text else ""
    return number(median)._replace(reach=reach, lower=low.value, upper=high.value)


def number(value: float, show: Callable[[float], str] = rounded) -> Cell:
    """Return a number's cell; empty for what is no number."""
    return Cell(show(value), repr(float(value))) if math.isfinite(value) else Cell()


def _table(
    name: str,
    caption: str,
    results: Sequence[Reported],
    tables: Sequence[pd.DataFrame],
    factor_names: Sequence[str],
    measures: Callable[[str, pd.DataFrame], list[_Measure]],
) -> Table:
    """Return long tables, one a result, as a wide one: rows by their factors, in order of first appearance."""
    factor_names = [factor for factor in factor_names if any(_is_given(table[factor]) for table in tables)]
    columns = [Column("", *HEADINGS[factor]) for factor in factor_names]
    cells_by_row: dict[tuple[Any, ...], dict[int, Cell]] = {}
    place = len(factor_names)
    for result, table in zip(results, tables, strict=True):
        keys = list(
            zip(
                *(table[factor].astype(object).where(table[factor].notna(), None) for factor in factor_names),
                strict=True,
            )
        )
        parameters = list(table["parameter"].unique())
        for parameter in parameters:
            mine = table["parameter"] == parameter
            rows = table[mine]
            rows.attrs["first"] = parameters[0]
            for measure in measures(str(parameter), rows):
                of_result = result.name if len(results) > 1 else ""
                columns.append(Column(of_result, label(measure.heading), label(measure.unit), number=True))
                of_rows = (key for key, one in zip(keys or [()] * len(table), mine, strict=True) if one)
                for key, (_, row) in zip(of_rows, rows.iterrows(), strict=True):
                    cells_by_row.setdefault(key, {})[place] = measure.cell(row)
                place += 1
    rows = [
        [*map(_factor_cell, factor_names, key), *(cells.get(i, Cell()) for i in range(len(factor_names), place))]
        for key, cells in cells_by_row.items()
    ]
    return Table(name, caption, columns, rows)


def _is_given(column: pd.Series) -> bool:
    return bool((column.notna() & (column != "")).any())


def _factor_cell(factor: str, value: Any) -> Cell:
    if HEADINGS[factor][2]:
        return number(math.nan if value is None else float(value), given)
    return Cell(label(value), str(value))
