"""`lsq`: Equation 2 fitted to each record separately."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from bayes_tyre.cli import shell
from bayes_tyre.cli.raw import Cluster, check_machines
from bayes_tyre.cli.shell import Out, Quiet, Records, Xlsx, assignments, progress, say, warn
from bayes_tyre.errors import BadInput
from bayes_tyre.runtime import prepare_jax

if TYPE_CHECKING:
    from bayes_tyre.inference.least_squares.settings import FitSettings
    from bayes_tyre.workflow.execution.batch import Machines


def _bounds(options: list[str]) -> dict[str, tuple[float, float]]:
    """Return NAME=LOW:HIGH options as a mapping, an empty side infinite; anything else is a usage error."""
    bounds: dict[str, tuple[float, float]] = {}
    for option in options:
        name, _, sides = option.partition("=")
        low, colon, high = sides.partition(":")
        try:
            pair = float(low or -math.inf), float(high or math.inf)
        except ValueError:
            colon = ""
        if not colon or not name:
            raise typer.BadParameter(f"{option!r} is not NAME=LOW:HIGH, such as k=0: or beta=:1", param_hint="--bounds")
        if name in bounds:
            raise typer.BadParameter(f"{name} is bounded twice; give both sides at once", param_hint="--bounds")
        bounds[name] = pair
    return bounds


def lsq(
    records: Records,
    out: Out,
    columns: shell.ColumnsMap = None,
    region: Annotated[
        Literal["all", "thesis"],
        typer.Option(
            help="all: all points, starting values from the data; thesis: the source's first 70 % and starting values."
        ),
    ] = "all",
    fix: Annotated[list[str] | None, typer.Option(help="NAME=VALUE held fixed: k, C, beta, d_i or F_i.")] = None,
    free: Annotated[list[str] | None, typer.Option(help="d_i or F_i: fit it; else it is the first point.")] = None,
    start: Annotated[list[str] | None, typer.Option(help="NAME=VALUE to start from (kN/mm, kN, mm).")] = None,
    bounds: Annotated[
        list[str] | None, typer.Option(help="NAME=LOW:HIGH (kN/mm, kN, mm); either side may be empty, such as beta=:1.")
    ] = None,
    loops: Annotated[
        bool,
        typer.Option(
            "--loops",
            help="Records are curves driven back and forth, in measured order: cut each at its reversals; a table "
            "without a column record is one curve.",
        ),
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Fit file by file, in so many processes; memory is that of a file in each."),
    ] = None,
    cluster: Cluster = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="File by file: only what is missing or has changed since the last run into --out."
        ),
    ] = False,
    xlsx: Xlsx = False,
    quiet: Quiet = False,
) -> None:
    """Fit Equation 2 to each record by least squares: k (kN/mm), C (kN), beta (mm), with standard errors.

    Writes least_squares.csv (with --xlsx least_squares.xlsx too), a row a record; status names what a record does not
    determine. With --loops a row a branch, and loops.csv, a row a closed cycle (energy in J by its area and by the law,
    secant stiffness in kN/mm, drift), backbone.csv (the mean of both branches, kN) and figures/loops.png. A reversal
    counts once the displacement has come back by 6 standard deviations of its noise or 3 of its smallest steps, 5 to
    10 % of the travel.

    With --workers, --cluster or --resume tables are fitted one by one, each into a cache in --out, so that an archive
    of many files need not fit into the memory.

    Example: bayes-tyre lsq data/campaign/records.csv --out results/lsq --region thesis
    """
    from bayes_tyre.inference.least_squares.settings import FitSettings

    check_machines(workers, cluster)
    by_file = workers is not None or cluster is not None or resume
    if loops and by_file:
        raise typer.BadParameter("goes with no --workers, --cluster or --resume", param_hint="--loops")
    fixed, starts = assignments(fix or [], "--fix"), assignments(start or [], "--start")
    try:
        settings = FitSettings(region, fixed, tuple(free or ()), starts, _bounds(bounds or []))
    except BadInput as error:
        raise typer.BadParameter(str(error)) from None
    if by_file:
        from bayes_tyre.workflow.execution.batch import Machines

        _fit_files(records, out, columns, settings, Machines(workers, cluster, resume), xlsx, quiet)
    else:
        _fit_together(records, out, columns, settings, loops, xlsx, quiet)
    if not quiet:
        _print_answer(out)


def _fit_files(
    records: Sequence[Path],
    out: Path,
    columns: Path | None,
    settings: "FitSettings",
    machines: "Machines",
    xlsx: bool,
    quiet: bool,
) -> None:
    """Fit each file separately, and print warnings about the files."""
    from bayes_tyre.workflow.least_squares_of_files import fit_files, table_tasks

    tasks, skipped = table_tasks(records, columns, settings)
    with progress("least squares, file by file", len(tasks), quiet) as on_progress:
        result = fit_files(tasks, machines, out, on_progress, xlsx=xlsx)
    for warning in (*skipped, *result.notes, *result.suspicions):
        warn(warning)


def _fit_together(
    records: Sequence[Path],
    out: Path,
    columns: Path | None,
    settings: "FitSettings",
    loops: bool,
    xlsx: bool,
    quiet: bool,
) -> None:
    """Fit all records, or loops, in one table, and print warnings about the files."""
    if loops:  # its figure imports matplotlib
        prepare_jax()
        from bayes_tyre.workflow.loops import fit_loops, read_loops

        table, suspicions = read_loops(records, columns, warn)
    else:
        table, suspicions, _ = shell.read_records(records, columns)
        prepare_jax()
        from bayes_tyre.workflow.least_squares import fit_least_squares

    for warning in suspicions:
        warn(warning)
    with progress("least squares", table["record"].nunique(), quiet) as on_progress:
        if loops:
            fit_loops(table, settings, out, on_progress, xlsx=xlsx)
        else:
            fit_least_squares(table, settings, out, on_progress, xlsx=xlsx)


def _print_answer(out: Path) -> None:
    """Print the tables of a folder, where they are, and how many records (or branches of loops) are not ok."""
    from bayes_tyre.report.terminal.fits_table import print_tables
    from bayes_tyre.results.separate_fits import read_fit_tables
    from bayes_tyre.workflow.least_squares import FITS, LOOPS

    fits, *cycles = tables = read_fit_tables(out, (FITS, LOOPS))
    print_tables(tables)
    say(f"wrote {out / FITS} (data: {fits.origin})", quiet=False)
    if cycles:
        closed = len(cycles[0].status)
        say(f"wrote loops.csv, backbone.csv and figures/loops.png beside it: {closed} closed cycles", quiet=False)
    say(f"{len(fits.status)} {'branches' if cycles else 'records'}, {fits.not_ok} not ok", quiet=False)
