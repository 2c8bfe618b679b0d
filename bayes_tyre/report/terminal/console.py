"""The console of the tables that commands print; a log file has them too."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

#: Characters of a line where no terminal says how many fit.
_WIDE = 10_000

type Headings = Iterable[tuple[str, Mapping[str, Any]]]


class LoggedConsole(Console):
    """Rich's console; what it prints goes, line by line, to the logger `bayes_tyre` as well."""

    def __init__(self, **options: Any) -> None:
        super().__init__(record=True, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does, then log the lines that are not blank."""
        super().print(*objects, **options)
        for line in filter(str.strip, self.export_text().splitlines()):
            logging.getLogger("bayes_tyre").debug("%s", line.rstrip())


def print_lines(lines: Iterable[str], console: Console) -> None:
    """Print texts, which are no markup, a line each however long it is."""
    for line in lines:
        console.print(Text(line), soft_wrap=True)


def table_of(headings: Headings, rows: Iterable[Sequence[str]]) -> Table:
    """Return a table: its headings, each with rich's options for the column, and its cells, which are no markup."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    for name, options in headings:
        table.add_column(Text(name), **options)
    for cells in rows:
        table.add_row(*map(Text, cells))
    return table


def print_table(headings: Headings, rows: Iterable[Sequence[str]], console: Console | None = None) -> None:
    """Print what `table_of` returns, on stdout by default; nothing is cut where there is no terminal."""
    console = console or LoggedConsole()
    wide = console if console.is_terminal else LoggedConsole(file=console.file, width=_WIDE)
    wide.print(table_of(headings, rows))
