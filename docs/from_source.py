"""Sphinx directives that take command help and priors from the program, and the preparation of docstrings."""

from typing import Any, NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

#: Probability inside the range shown of a prior, equal-tailed.
RANGE = 0.95


class Help(NamedTuple):
    """A command, such as ``study outliers``, and the text that its ``--help`` prints."""

    command: str
    text: str


#: Type of the descriptor of a named tuple's field.
_FIELD_OF_TUPLE = type(vars(Help)["command"])


def commands() -> list[Help]:
    """Return the help of every command, those of groups included, in the program's order."""
    import typer
    from typer.testing import CliRunner

    from bayes_tyre.cli import app

    def named(command: Any, path: tuple[str, ...]) -> list[tuple[str, ...]]:
        below = getattr(command, "commands", {})
        return [path, *(name for key, one in below.items() for name in named(one, (*path, key)))]

    runner, helps = CliRunner(), []
    for path in named(typer.main.get_command(app), ()):
        done = runner.invoke(app, [*path, "--help"], prog_name="bayes-tyre")
        if done.exit_code != 0:
            raise RuntimeError(f"bayes-tyre {' '.join(path)} --help: exit code {done.exit_code}")
        helps.append(Help(" ".join(path), done.stdout.strip()))
    return helps


def prior_rows() -> list[tuple[str, ...]]:
    """Return a row a prior: its name, distribution, median with its range and unit, and the reason for its width."""
    from bayes_tyre.inference.model.default_priors import PRIORS

    rows = []
    for name, prior in PRIORS.items():
        low, median, high = (f"{q:.2g}" for q in prior.scipy().ppf([(1 - RANGE) / 2, 0.5, (1 + RANGE) / 2]))
        distribution = f"{prior.family.__name__}({', '.join(f'{value:.3g}' for value in prior.parameters)})"
        rows.append((name, distribution, f"{median} ({low} to {high}) {prior.unit}".strip(), prior.reason))
    return rows


def table(header: tuple[str, ...], rows: list[tuple[str, ...]], codes: int) -> nodes.table:
    """Return a table of plain text, its first `codes` columns in code type."""

    def row(cells: tuple[str, ...], heading: bool) -> nodes.row:
        entries = nodes.row()
        for number, text in enumerate(cells):
            kind = nodes.literal if text and number < codes and not heading else nodes.Text
            paragraph = nodes.paragraph("", "", kind("", text) if kind is nodes.literal else nodes.Text(text))
            entries += nodes.entry("", paragraph)
        return entries

    group = nodes.tgroup("", *(nodes.colspec(colwidth=1) for _ in header), cols=len(header))
    group += nodes.thead("", row(header, True))
    group += nodes.tbody("", *(row(cells, False) for cells in rows))
    return nodes.table("", group, classes=["colwidths-auto"])


class CommandHelp(SphinxDirective):
    """`command-help`: a section a command, with what `--help` prints."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        parts = []
        for command, text in commands():
            title = f"bayes-tyre {command}".strip()
            parts.append(f"## `{title}`\n\n```text\n{text}\n```\n")
        return self.parse_text_to_nodes("\n".join(parts), allow_section_headings=True)


class PriorTable(SphinxDirective):
    """`prior-table`: every prior with the reason for its width."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        header = ("prior", "distribution", f"median ({100 * RANGE:.0f} % range)", "what it allows, and why")
        return [table(header, prior_rows(), codes=1)]


def ready(lines: list[str]) -> list[str]:
    """Return a docstring's lines in the form that napoleon and docutils parse correctly.

    Otherwise a Returns section of plain sentences, as used in this package, would be parsed as a type, attributes
    described together (``low, high:``) as one attribute with a type, a source below the parameters as a parameter,
    and ``|step_kN|`` as a substitution.
    """
    section, prepared = "", []
    for number, line in enumerate(lines):
        below = lines[number + 1] if number + 1 < len(lines) else ""
        if below and set(below) == {"-"}:
            section = line
            prepared.append({"Attributes": "Fields"}.get(line, line))
        elif section == "Attributes" and line.endswith(":") and not line.startswith(" "):
            prepared.append(", ".join(f"``{name}``" for name in line[:-1].split(", ")))
        elif section == "Raises" and line == "BadInput":
            prepared.append("bayes_tyre.errors.BadInput")
        elif section and line.startswith("Source: "):
            section = "Source"
            prepared += [section, "-" * len(section), line.removeprefix("Source: ")]
        else:
            prepared.append("`".join(_without_bars(line.split("`"))))
    return _with_sentences_returned(prepared)


def _with_sentences_returned(lines: list[str]) -> list[str]:
    """Return a docstring's lines with a Returns section of plain sentences marked as being of no type."""
    heads = (i for i, line in enumerate(lines[:-2]) if line == "Returns" and set(lines[i + 1]) == {"-"})
    head = next(heads, None)
    if head is None:
        return lines
    entry = head + 2
    end = next((i for i in range(entry, len(lines)) if not lines[i].strip()), len(lines))
    if any(line.startswith(" ") for line in lines[entry:end]):  # a type, and what it holds below it
        return lines
    return [*lines[:entry], ":", *(f"    {line}" for line in lines[entry:end]), *lines[end:]]


def _without_bars(parts: list[str]) -> list[str]:
    """Return the text between backticks unchanged, and the rest with its vertical bars escaped."""
    return [part if number % 2 else part.replace("|", r"\|") for number, part in enumerate(parts)]


class Docstrings:
    """Prepare docstrings for napoleon, and exclude comments on values from it.

    In ``#: Scatter: of one test`` napoleon would take the first word for a type.
    """

    def __init__(self) -> None:
        self._of_values: dict[str, list[str]] = {}

    def before(self, app: Sphinx, what: str, name: str, it: object, options: object, lines: list[str]) -> None:
        """Prepare the lines, and store those of a value."""
        del app, it, options
        lines[:] = ready(lines)
        if what in ("attribute", "data", "property"):
            self._of_values[name] = list(lines)

    def after(self, app: Sphinx, what: str, name: str, it: object, options: object, lines: list[str]) -> None:
        """Restore the stored lines of a value."""
        del app, what, it, options
        lines[:] = self._of_values.pop(name, lines)


def _skip(app: Sphinx, what: str, name: str, it: object, skip: bool, options: object) -> bool | None:
    """Skip the automatic descriptions of a named tuple's fields: the class docstring describes them."""
    del app, what, name, options
    return True if isinstance(it, _FIELD_OF_TUPLE) else (skip or None)


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the directives, and the docstrings' treatment before and after napoleon's, whose priority is 500."""
    app.add_directive("command-help", CommandHelp)
    app.add_directive("prior-table", PriorTable)
    docstrings = Docstrings()
    app.connect("autodoc-process-docstring", docstrings.before, priority=400)
    app.connect("autodoc-process-docstring", docstrings.after, priority=600)
    app.connect("autodoc-skip-member", _skip)
    return {"parallel_read_safe": True}
