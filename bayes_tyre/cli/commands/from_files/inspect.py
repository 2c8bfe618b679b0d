"""`inspect`: the channels of raw files, a row a channel and segment."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli import suffixes
from bayes_tyre.cli.shell import Quiet, progress, say, warn
from bayes_tyre.plain_text import one_line

if TYPE_CHECKING:
    import pandas as pd


def inspect(
    raw: Annotated[list[Path], typer.Argument(metavar="RAW", help=f"Raw files ({suffixes.RAW}), or folders of them.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write (.csv or .parquet); default: to the terminal.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """List the channels of raw files: a row a channel and segment, in the units of the file, such as (mm, kN); X in s.

    Columns: file, segment, channel, unit, samples, dt_s, first, last, min, max, missing. X is no channel. Notes
    on a file, such as fewer samples than its header declares, go to stderr, a line each. So does a file that cannot be
    read: the others are still listed, but nothing is written to --out, and the exit code is 3.

    Example: bayes-tyre inspect data/sample/appendix_b1.lvm --out results/channels.csv
    """
    from bayes_tyre.errors import BadInput
    from bayes_tyre.formats.recordings.raw import raw_files
    from bayes_tyre.workflow.raw.inspect import inspect_raw

    files, skipped = raw_files(raw)
    with progress("inspect", len(files), quiet) as advance:
        table, notes, faults = inspect_raw(files, out, advance)
    if len(files) == len(faults) == 1:
        raise BadInput(faults[0])
    for text in [*skipped, *notes, *faults]:
        warn(text)
    if (out is None or faults) and len(table) and not quiet:
        _print(table)
    if faults:
        unwritten = "" if out is None else f", so that {out} is not written"
        raise BadInput(f"{len(faults)} of {len(files)} files cannot be read{unwritten}; mend them, or name the others")
    if out is not None:
        say(f"wrote {out}", quiet)


def _print(channels: "pd.DataFrame") -> None:
    from bayes_tyre.report.terminal.console import print_table

    text_columns = ("file", "channel", "unit")
    justify = ("left" if name in text_columns else "right" for name in channels.columns)
    headings = [
        (name, {"justify": how, "overflow": "fold"}) for name, how in zip(channels.columns, justify, strict=True)
    ]
    print_table(headings, ([_cell(value) for value in row] for row in channels.itertuples(index=False)))


def _cell(value: object) -> str:
    """Return a cell as text that is safe on a terminal; NaN is blank."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.6g}"
    return one_line(value, None)
