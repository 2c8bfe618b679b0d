"""Text of files that vehicle simulators read: property file, Modelica record and table, spline. All of it is ASCII."""

from collections.abc import Iterable, Mapping, Sequence

from bayes_tyre.plain_text import comments

type Rows = Iterable[tuple[float, float]]


def property_file(sections: Mapping[str, Mapping[str, str | float]], about: Sequence[str], curves: Mapping) -> str:
    """Return a tyre property file (`.tir`): sections of keys and values, then `curves`: names of columns, and rows."""
    lines = comments(about, "$ ")
    for section, entries in sections.items():
        lines += [f"[{section}]", *(f"{key} = {value!r}" for key, value in entries.items())]
    for section, (columns, rows) in curves.items():
        lines += [f"[{section}]", f"{{{columns}}}", *(f"{x!r} {y!r}" for x, y in rows)]
    return "\n".join(lines) + "\n"


def modelica_record(name: str, parameters: Mapping[str, tuple[float, str, str]], about: Sequence[str]) -> str:
    """Return a Modelica record (`.mo`); each parameter has a value, a unit and a description."""
    lines = [
        f'  parameter Real {key}(unit="{unit}") = {value!r} "{description}";'
        for key, (value, unit, description) in parameters.items()
    ]
    return "\n".join([f"record {name}", *comments(about, "  // "), *lines, f"end {name};"]) + "\n"


def combi_table(name: str, rows: Rows, about: Sequence[str]) -> str:
    """Return a table of two columns for Modelica's CombiTable1D, which finds it by its name in the file."""
    numbers = [f"{x!r} {y!r}" for x, y in rows]
    return "\n".join(["#1", *comments(about, "# "), f"double {name}({len(numbers)},2)", *numbers]) + "\n"


def spline_file(rows: Rows, about: Sequence[str]) -> str:
    """Return two columns of numbers with a comma between them, below comments."""
    return "\n".join([*comments(about, "# "), *(f"{x!r},{y!r}" for x, y in rows)]) + "\n"
