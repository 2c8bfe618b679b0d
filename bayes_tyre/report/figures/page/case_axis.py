"""Lists of cases down an axis: their order, their labels, the headings of groups."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bayes_tyre.record import CASE_FACTORS, DIRECTIONS
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import TALLEST
from bayes_tyre.results.columns import numbers, texts

#: The fewest lines that a panel is drawn for: fewer would stand far apart.
FEWEST = 4
#: The least height of a line that can carry a label, inches.
LABEL = 0.12
#: The most panels side by side, and what a further row of them needs beside its lines, inches.
ACROSS, _BETWEEN_ROWS = 3, 0.6


def case_axis_name(factors: pd.DataFrame) -> str:
    """Return the name of an axis of cases: what `case_label` writes of them, with units."""
    speed = "(speed, km/h)\n" if numbers(factors, "speed_km_h").notna().any() else ""
    load, step = (numbers(factors, name).notna().any() for name in ("initial_load_kN", "step_kN"))
    loads = ("first load-last load, kN" if step else "initial load, kN") if load else "step, kN" if step else ""
    return f"case: {speed}{loads}".strip() if speed or loads else "case"


def direction_rank(direction: str) -> tuple[int, str]:
    """Return the sorting key of a direction: loading, unloading, others by name, not stated."""
    rank = DIRECTIONS.index(direction) if direction in DIRECTIONS else len(DIRECTIONS)
    return (rank if direction else rank + 1), direction


def case_factors(table: pd.DataFrame) -> pd.DataFrame:
    """Return the five factors of a case (km/h, kN) for each row, "" or NaN where the table does not say."""
    text = ("configuration", "direction")
    return pd.DataFrame(
        {factor: texts(table, factor) if factor in text else numbers(table, factor) for factor in CASE_FACTORS}
    )


def in_order(table: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return the rows sorted by the columns, directions by their rank, missing numbers last."""
    return table.sort_values(
        list(columns),
        key=lambda column: column.map(direction_rank) if column.name == "direction" else column,
        kind="stable",
        ignore_index=True,
    )


def numbered(factors: pd.DataFrame) -> pd.DataFrame:
    """Return the table with a column `nth` that counts the rows sharing all their factors, from 0."""
    return factors.assign(nth=factors.groupby(list(factors.columns), dropna=False).cumcount())


def case_label(speed_km_h: float, initial_load_kN: float, step_kN: float) -> str:
    """Return the source's way of writing a case, such as ``(0)30-20``, as far as the factors are given."""
    speed = "" if math.isnan(speed_km_h) else f"({speed_km_h:g})"
    if math.isnan(initial_load_kN):
        return speed if math.isnan(step_kN) else f"{speed}{step_kN:+g}"
    last = "" if math.isnan(step_kN) else f"-{initial_load_kN + step_kN:g}"
    return f"{speed}{initial_load_kN:g}{last}"


def line_label(record: pd.Series) -> str:
    """Return the label of a record's case, or its name when no case is known; the direction if no step shows it."""
    case = case_label(record["speed_km_h"], record["initial_load_kN"], record["step_kN"])
    label = case or plain(record["record"], 24)
    return f"{label} {plain(record['direction'], 24)}".rstrip() if math.isnan(record["step_kN"]) else label


class Line(NamedTuple):
    """One line of a list: how far down it stands, its text, and whether it heads a group."""

    y: int
    text: str
    heads: bool


def list_lines(headings: Sequence[str], labels: Sequence[str]) -> list[Line]:
    """Return a line for each label, below a line for its heading wherever that changes (none where it is "")."""
    lines: list[Line] = []
    before = ""
    for heading, label in zip(headings, labels, strict=True):
        if heading != before:
            lines.append(Line(len(lines), heading, True))
        before = heading
        lines.append(Line(len(lines), label, False))
    return lines


def grouped_lines(rows: pd.DataFrame) -> list[Line]:
    """Return the lines that list cases (their factors and `nth`) under their configuration and direction."""
    headings, labels = [], []
    for i, row in enumerate(rows.to_dict("records")):
        headings.append(", ".join(plain(row[factor], 24) for factor in ("configuration", "direction") if row[factor]))
        label = case_label(row["speed_km_h"], row["initial_load_kN"], row["step_kN"])
        labels.append(f"{label} #{row['nth'] + 1}" if label and row["nth"] else label or f"case {i + 1}")
    return list_lines(headings, labels)


def parameter_panels(count: int, spare: float, line: float, room: int, axis: str) -> tuple[Figure, list[Axes], float]:
    """Return a page with a list of `room` lines for each parameter, its panels row by row, and the height of a line.

    At most `ACROSS` panels stand side by side; `spare` is the height that a page with one row of them needs beside the
    lines, and `line` that of a line where the page does not get too tall, inches. `axis` names the axis of lines.
    """
    across = min(ACROSS, count)
    down = math.ceil(count / across)
    spare += _BETWEEN_ROWS * (down - 1)
    figure = layout.page(layout.wide(across), min(TALLEST, spare + line * room * down))
    axes = list(figure.subplots(down, across, sharey=True, squeeze=False).ravel())
    for ax in axes[count:]:
        ax.remove()
    for ax in axes[:count:across]:
        ax.set_ylabel(axis)
    return figure, axes[:count], min(line, (TALLEST - spare) / (room * down))


def name_lines(ax: Axes, lines: Sequence[Line], inches: float, room: int) -> None:
    """Write the lines' texts on the y axis, downwards; as many as fit when a line, of `room` in all, has few inches."""
    apart = max(1, math.ceil(LABEL / inches))
    shown: list[Line] = []
    for line in lines:
        if shown and line.heads and line.y - shown[-1].y < apart and not shown[-1].heads:
            shown.pop()
        if not shown or line.y - shown[-1].y >= apart:
            shown.append(line)
    ax.set_yticks([line.y for line in shown], [line.text for line in shown])
    for line, tick in zip(shown, ax.yaxis.get_major_ticks(), strict=True):
        tick.label1.set_fontweight("bold" if line.heads else "normal")
    ax.set_ylim(max(1, room) - 0.2, -0.8)
    ax.tick_params(axis="y", length=0)
    ax.hlines(
        [line.y for line in lines if not line.heads],
        0,
        1,
        "#e4e4e4",
        linewidth=0.5,
        zorder=0.5,
        transform=ax.get_yaxis_transform(),
    )
