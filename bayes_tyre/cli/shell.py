"""What all commands share: options, faults turned into exit codes, progress, and what goes to which stream."""

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayes_tyre.cli.interrupt import heeding_interrupts
from bayes_tyre.cli.messages import fault, one_line_each, say
from bayes_tyre.cli.messages import warn as warn  # to commands it is one of the things shared
from bayes_tyre.errors import BadInput

if TYPE_CHECKING:
    import pandas as pd

    from bayes_tyre.inference.diagnostics import Diagnostics

BAD_INPUT, NOT_TRUSTED = 3, 4

Records = Annotated[
    Path,
    typer.Argument(
        help="Record table (.csv or .parquet): record, displacement_mm, force_kN; optional time_s, configuration, "
        "direction, speed_km_h, initial_load_kN, step_kN, repeat, origin."
    ),
]
Out = Annotated[Path, typer.Option(help="Folder to write into; made if it is not there.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors and warnings.")]
Chains = Annotated[int, typer.Option(min=1, help="Chains, run side by side.")]
Warmup = Annotated[int, typer.Option(min=1, help="Iterations of each chain to adapt.")]
Draws = Annotated[int, typer.Option(min=4, help="Iterations of each chain to keep.")]
Seed = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="The same seed, data and options give the same numbers.")]
Interval = Annotated[float, typer.Option(min=0.01, max=0.999, help="Probability of every interval, equal-tailed.")]


def guarded(command: Callable[..., None]) -> Callable[..., None]:
    """Turn bad input and disks that refuse into one line on stderr and exit code 3; warnings into a line each."""

    @functools.wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            with one_line_each(), heeding_interrupts():
                command(*args, **kwargs)
        except BadInput as error:
            fault(error)
            raise typer.Exit(BAD_INPUT) from None
        except BrokenPipeError:  # who read the output has seen enough; Typer ends quietly
            raise
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            fault(f"{where}{error.strerror or error}; check the path and the disk")
            raise typer.Exit(BAD_INPUT) from None

    return run


def on_terminal(quiet: bool) -> bool:
    """Return whether somebody watches stderr and wants to."""
    return sys.stderr.isatty() and not quiet


@contextmanager
def progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Give a function to call with the number just done; it draws a bar on stderr when that is a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), disable=not on_terminal(quiet), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.advance(task, done)


def read_records(path: Path) -> "pd.DataFrame":
    """Return a record table from disk, checked."""
    from bayes_tyre.formats.tables import read_table
    from bayes_tyre.record_table import check_record_table

    return check_record_table(read_table(path), str(path))


def assignments(options: list[str], flag: str) -> dict[str, float]:
    """Return NAME=VALUE options as a mapping; anything else is a usage error."""
    values = {}
    for option in options:
        name, equals, value = option.partition("=")
        try:
            values[name] = float(value)
        except ValueError:
            equals = ""
        if not equals or not name:
            raise typer.BadParameter(f"{option!r} is not NAME=VALUE, such as {flag} k=1.8", param_hint=flag)
    return values


def report_verdict(diagnostics: "Diagnostics", out: Path, quiet: bool) -> None:
    """Print where a fit was written and its verdict; each reason against it on stderr."""
    say(f"wrote {out}: verdict {diagnostics.verdict}", quiet)
    for reason in diagnostics.reasons:
        fault(reason)
