"""`inspect`: what raw files hold, a row a channel and segment."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli.shell import Quiet, progress, say, warn

if TYPE_CHECKING:
    import pandas as pd

#: Columns of a table that goes to no terminal: wide enough that nothing is cut.
_WIDE = 10_000


def inspect(
    raw: Annotated[
        list[Path],
        typer.Argument(metavar="RAW", help="Raw files (.lvm, .tdms, .xlsx, .csv, .parquet), or folders of them."),
    ],
    out: Annotated[
        Path | None, typer.Option(help="File to write (.csv or .parquet); default: to the terminal.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Say what raw files hold: a row a channel and segment, in the units of the file, such as (mm, kN); X in s.

    Columns: file, segment, channel, unit, samples, dt_s, first, last, min, max, missing. X is no channel. What is odd
    about a file, such as fewer samples than its header promises, goes to stderr, a line each.

    Example: bayes-tyre inspect data/sample/appendix_b1.lvm --out results/channels.csv
    """
    from bayes_tyre.formats.raw import raw_files
    from bayes_tyre.workflow.inspect import inspect_raw

    files, passed_over = raw_files(raw)
    with progress("inspect", len(files), quiet) as advance:
        table, remarks = inspect_raw(files, out, advance)
    for remark in [*passed_over, *remarks]:
        warn(remark)
    if out is None:
        if not quiet:
            _print(table)
    else:
        say(f"wrote {out}", quiet)


def _print(table: "pd.DataFrame") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDE)
    shown = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    texts = ("file", "channel", "unit")
    for name in table.columns:
        shown.add_column(name, justify="left" if name in texts else "right", overflow="fold")
    for row in table.itertuples(index=False):
        shown.add_row(*(Text(_cell(value)) for value in row))
    console.print(shown)


def _cell(value: object) -> str:
    """Return a cell as text: what would steer a terminal is escaped, a number that is not there is blank."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.6g}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(value))
