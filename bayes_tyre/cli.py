"""The commands of `bayes-tyre`. Whatever computes is imported inside a command: `--help` must not wait for JAX."""

import functools
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayes_tyre.errors import BadInput

if TYPE_CHECKING:
    import pandas as pd

app = typer.Typer(
    name="bayes-tyre",
    help="Identify the stiffness k (kN/mm) and characteristic deflection beta (mm) of tyres, with honest uncertainty.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

BAD_INPUT, NOT_TRUSTED = 3, 4


class Region(StrEnum):
    """Which points of a record least squares uses."""

    all = "all"
    thesis = "thesis"


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


def _faults(command: Callable[..., None]) -> Callable[..., None]:
    """Turn bad input and disks that refuse into one line on stderr and exit code 3."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except BadInput as error:
            typer.echo(f"bayes-tyre: {' '.join(str(error).split())}", err=True)
            raise typer.Exit(BAD_INPUT) from None
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            typer.echo(f"bayes-tyre: {where}{error.strerror or error}; check the path and the disk", err=True)
            raise typer.Exit(BAD_INPUT) from None

    return guarded


def _say(text: str, quiet: bool) -> None:
    if not quiet:
        typer.echo(text)


def _on_terminal(quiet: bool) -> bool:
    return sys.stderr.isatty() and not quiet


@contextmanager
def _progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Give a function to call with the number just done; it draws a bar on stderr when that is a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), disable=not _on_terminal(quiet), transient=True) as progress:
        task = progress.add_task(what, total=total)
        yield lambda done: progress.advance(task, done)


def _read_records(path: Path) -> "pd.DataFrame":
    from bayes_tyre.formats.tables import read_table
    from bayes_tyre.record import check_record_table

    return check_record_table(read_table(path), str(path))


def _assignments(options: list[str], flag: str) -> dict[str, float]:
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


@app.callback(invoke_without_command=True)
def main(show_version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    """Identify the stiffness and hysteresis of tyres."""
    if show_version:
        typer.echo(version("bayes-tyre"))
        raise typer.Exit


@app.command()
@_faults
def published(
    out: Out,
    posterior: Annotated[bool, typer.Option("--posterior", help="Also fit Tables 9 and 11 themselves.")] = False,
    chains: Chains = 4,
    warmup: Warmup = 1000,
    draws: Draws = 2000,
    seed: Seed = 0,
    interval: Interval = 0.95,
    quiet: Quiet = False,
) -> None:
    """Recompute what the source prints and can be recomputed; --posterior fits its Tables 9 and 11 (kN/mm, mm).

    Writes published_check.csv (quantity, source, kind, published, recomputed, tolerance, agrees) and posterior/.

    Example: bayes-tyre published --out results/published --posterior
    """
    from bayes_tyre.runtime import prepare_jax

    prepare_jax(chains)
    from bayes_tyre import workflow
    from bayes_tyre.inference.sampling import SamplerSettings

    check = workflow.check_published(out)
    counts = check.groupby("kind", sort=False)["agrees"].agg(["sum", "size"])
    _say(f"wrote {out / 'published_check.csv'}", quiet)
    for kind, (agree, size) in counts.iterrows():
        _say(f"  {kind}: {agree} of {size} agree", quiet)
    trusted = bool(check["agrees"].all())
    if posterior:
        settings = SamplerSettings(chains, warmup, draws, seed, _on_terminal(quiet))
        diagnostics = workflow.fit_published_tables(out / "posterior", settings, interval, sys.argv[1:])
        _report_verdict(diagnostics, out / "posterior", quiet)
        trusted = trusted and diagnostics.verdict == "pass"
    if not trusted:
        raise typer.Exit(NOT_TRUSTED)


@app.command()
@_faults
def campaign(
    out: Annotated[Path, typer.Option(help="Record table to write (.csv or .parquet); its truth goes beside it.")],
    seed: Annotated[int | None, typer.Option(min=0, help="Another campaign than the one in data/campaign.")] = None,
    quiet: Quiet = False,
) -> None:
    """Reconstruct records from the published tables: 48 cases x 3 repeats (mm, kN). Nothing in it was measured.

    Least squares on it returns the printed k and beta. The same file comes out every time.

    Example: bayes-tyre campaign --out data/campaign/records.csv
    """
    from bayes_tyre import workflow

    for path in workflow.write_campaign(out, seed):
        _say(f"wrote {path} (reconstructed, not measured)", quiet)


@app.command()
@_faults
def lsq(
    records: Records,
    out: Out,
    region: Annotated[
        Region,
        typer.Option(help="all points, starts found from the data; or the thesis's first 70 % and its starts."),
    ] = Region.all,
    fix: Annotated[list[str] | None, typer.Option(help="NAME=VALUE held fixed: k, C, beta, d_i or F_i.")] = None,
    free: Annotated[list[str] | None, typer.Option(help="d_i or F_i: fit it; else it is the first point.")] = None,
    start: Annotated[list[str] | None, typer.Option(help="NAME=VALUE to start from (kN/mm, kN, mm).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Taken as by every command; least squares draws nothing.")] = 0,
    quiet: Quiet = False,
) -> None:
    """Fit Equation 2 to each record by least squares: k (kN/mm), C (kN), beta (mm), with standard errors.

    Writes least_squares.csv, a row a record; status says what a record does not determine.

    Example: bayes-tyre lsq data/campaign/records.csv --out results/lsq --region thesis
    """
    from bayes_tyre.runtime import prepare_jax

    fixed, starts = _assignments(fix or [], "--fix"), _assignments(start or [], "--start")
    table = _read_records(records)
    prepare_jax()
    from bayes_tyre import workflow
    from bayes_tyre.inference.record_fits import FitSettings
    from bayes_tyre.record import origin_of, suspicious_units

    del seed  # least squares draws nothing

    try:
        settings = FitSettings(region=region.value, fix=fixed, free=tuple(free or ()), start=starts)
    except BadInput as error:
        raise typer.BadParameter(str(error)) from None
    for warning in suspicious_units(table):
        typer.echo(f"bayes-tyre: warning: {records}: {warning}", err=True)
    with _progress("least squares", table["record"].nunique(), quiet) as on_progress:
        fits = workflow.fit_least_squares(table, settings, out, on_progress)
    odd = int((fits["status"] != "ok").sum())
    _say(f"wrote {out / 'least_squares.csv'} (data: {origin_of(table)})", quiet)
    _say(f"{len(fits)} records, {odd} not ok", quiet)


@app.command()
@_faults
def fit(
    records: Records,
    out: Out,
    chains: Chains = 4,
    warmup: Warmup = 600,
    draws: Draws = 1500,
    seed: Seed = 0,
    interval: Interval = 0.95,
    units_checked: Annotated[bool, typer.Option("--units-checked", help="The forces are kN, travel is mm.")] = False,
    quiet: Quiet = False,
) -> None:
    """Fit all records together, hierarchically: posteriors of k, beta, J, C and sigma (kN, mm), none dropped.

    Writes posterior.nc, summary.csv, cases.csv, contrasts.csv, repeats.csv, diagnostics.json, run.json and
    figures/. Ends with code 4 when the sampler's diagnostics say that the result is not to be trusted.

    Example: bayes-tyre fit data/campaign/records.csv --out results/fit
    """
    from bayes_tyre.runtime import prepare_jax

    table = _read_records(records)
    prepare_jax(chains)
    from bayes_tyre import workflow
    from bayes_tyre.inference.sampling import SamplerSettings
    from bayes_tyre.record import origin_of, suspicious_units

    suspicions = suspicious_units(table)
    if suspicions and not units_checked:
        raise BadInput(f"{records}: {suspicions[0]}; or say --units-checked")
    _say(f"fitting {table['record'].nunique()} records (data: {origin_of(table)}), {chains} chains", quiet)
    began = time.monotonic()
    settings = SamplerSettings(chains, warmup, draws, seed, _on_terminal(quiet))
    diagnostics = workflow.fit_table(table, records, out, settings, interval, sys.argv[1:])
    _say(f"done in {time.monotonic() - began:.0f} s", quiet)
    _report_verdict(diagnostics, out, quiet)
    if diagnostics.verdict != "pass":
        raise typer.Exit(NOT_TRUSTED)


@app.command()
@_faults
def show(
    results: Annotated[list[Path], typer.Argument(help="Folders that fit or published --posterior wrote.")],
) -> None:
    """Print k (kN/mm) and beta (mm) by configuration and direction, with intervals, from results on disk.

    Example: bayes-tyre show results/published/posterior results/fit
    """
    from bayes_tyre.report.overview import print_overview

    print_overview(results)


def _report_verdict(diagnostics: Any, out: Path, quiet: bool) -> None:
    _say(f"wrote {out}: verdict {diagnostics.verdict}", quiet)
    for reason in diagnostics.reasons:
        typer.echo(f"bayes-tyre: {reason}", err=True)


if __name__ == "__main__":
    app()
