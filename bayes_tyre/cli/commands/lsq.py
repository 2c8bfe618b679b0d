"""`lsq`: Equation 2 fitted to each record separately."""

import math
from typing import Annotated, Literal

import typer

from bayes_tyre.cli.shell import NoSeed, Out, Quiet, Records, Xlsx, assignments, progress, read_records, say, warn
from bayes_tyre.errors import BadInput


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
    region: Annotated[
        Literal["all", "thesis"],
        typer.Option(help="all points, starts found from the data; or the thesis's first 70 % and its starts."),
    ] = "all",
    fix: Annotated[list[str] | None, typer.Option(help="NAME=VALUE held fixed: k, C, beta, d_i or F_i.")] = None,
    free: Annotated[list[str] | None, typer.Option(help="d_i or F_i: fit it; else it is the first point.")] = None,
    start: Annotated[list[str] | None, typer.Option(help="NAME=VALUE to start from (kN/mm, kN, mm).")] = None,
    bounds: Annotated[
        list[str] | None, typer.Option(help="NAME=LOW:HIGH (kN/mm, kN, mm); either side may be empty, such as beta=:1.")
    ] = None,
    xlsx: Xlsx = False,
    seed: NoSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Fit Equation 2 to each record by least squares: k (kN/mm), C (kN), beta (mm), with standard errors.

    Writes least_squares.csv (with --xlsx least_squares.xlsx too), a row a record; status names what a record does not
    determine.

    Example: bayes-tyre lsq data/campaign/records.csv --out results/lsq --region thesis
    """
    from bayes_tyre.inference.least_squares.settings import FitSettings
    from bayes_tyre.record_table import origin_of, suspicious_units
    from bayes_tyre.runtime import prepare_jax

    del seed
    fixed, starts = assignments(fix or [], "--fix"), assignments(start or [], "--start")
    try:
        settings = FitSettings(region, fixed, tuple(free or ()), starts, _bounds(bounds or []))
    except BadInput as error:
        raise typer.BadParameter(str(error)) from None
    table = read_records(records)
    prepare_jax()
    from bayes_tyre.workflow.least_squares import fit_least_squares

    for warning in suspicious_units(table):
        warn(f"{records}: {warning}")
    with progress("least squares", table["record"].nunique(), quiet) as on_progress:
        fits = fit_least_squares(table, settings, out, on_progress, xlsx=xlsx)
    failed = int((fits["status"] != "ok").sum())
    say(f"wrote {out / 'least_squares.csv'} (data: {origin_of(table)})", quiet)
    say(f"{len(fits)} records, {failed} not ok", quiet)
