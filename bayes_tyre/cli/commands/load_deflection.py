"""`load-deflection`: slow tests, load up and down in steps: two lines, friction, and the energy of the loop."""

from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli import suffixes
from bayes_tyre.cli.shell import ColumnsMap, Out, Quiet, say, warn
from bayes_tyre.runtime import prepare_jax


def load_deflection(
    table: Annotated[
        list[Path],
        typer.Argument(
            metavar="TABLE...",
            help=f"Tables of readings ({suffixes.TABLE}), or folders of them, a row a reading, in measured order: "
            "test (a name), load_kN of the cylinder, displacement_mm at the measurement point since first touch; "
            "optional configuration, speed_km_h, repeat, direction (loading or unloading), origin. Other names and "
            "units: --columns.",
        ),
    ],
    out: Out,
    columns: ColumnsMap = None,
    rig: Annotated[
        str | None,
        typer.Option(
            help="Rig: single, dual, a TOML file, or none where load and displacement are the tyre's own, on flat "
            "ground; default: the one the configuration names."
        ),
    ] = None,
    beta: Annotated[
        float | None, typer.Option(help="beta (mm) from step records: slow readings lie too far apart for it.")
    ] = None,
    steps: Annotated[
        Path | None,
        typer.Option(
            help="least_squares.csv of the same tyres: writes the k (kN/mm) that both share, and the tension."
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Fit slow load-deflection tests: stiffness k (kN/mm) loading and unloading, friction x (kN), energy a cycle (J).

    A test is one cycle, load up in steps and down again; a curve of several, without directions, is cut into them at
    its reversals. Straight lines as in the source, the reading of the greatest load on both lines unless the table
    gives directions; then Fancher's law through both branches, with x > k beta. k, C, x and beta are as on flat ground,
    energies at the wheel centre (areas on flat ground, in columns that begin with flat_ground, are no work done).

    Writes load_deflection.csv, a row a test; load_deflection_cases.csv, where repeats could be averaged, as the source
    does, a row a case; shared_stiffness.csv with --steps; figures/. status names what a test does not determine: beta
    and x, unless its readings are closer together than beta.

    Example: bayes-tyre load-deflection slow_tests.csv --out results/slow --steps results/lsq/least_squares.csv
    """
    if beta is not None and not 0 < beta < float("inf"):
        raise typer.BadParameter(f"{beta:g} is no length; beta is in mm, above 0", param_hint="--beta")
    from bayes_tyre.record_table import origin_of

    prepare_jax()
    from bayes_tyre.workflow.load_deflection import SLOW_TESTS, fit_load_deflection
    from bayes_tyre.workflow.record_tables import names, read_given

    readings, suspicions, notes = read_given(table, columns, SLOW_TESTS)
    for warning in [*notes, *suspicions]:
        warn(warning)
    result = fit_load_deflection(readings, out, rig=rig, beta_mm=beta, steps=steps)
    for text in result.notes:
        warn(f"{names(table)}: {text}")
    if not quiet:
        _print_answer(out, result.paths)
    for path in result.paths:
        say(f"wrote {path} (data: {origin_of(readings)})", quiet)
    if result.shared is not None:
        _print_shared(len(result.shared), int((result.shared["status"] != "ok").sum()), quiet)
    failed = int((result.tests["status"] != "ok").sum())
    say(f"{len(result.tests)} tests, {failed} not ok", quiet)


def _print_answer(out: Path, paths: list[Path]) -> None:
    """Print the tables that were written."""
    from bayes_tyre.report.terminal.fits_table import print_tables
    from bayes_tyre.results.separate_fits import read_fit_tables

    print_tables(read_fit_tables(out, tuple(path.name for path in paths if path.suffix == ".csv")))


def _print_shared(cases: int, in_tension: int, quiet: bool) -> None:
    if not cases:
        warn("--steps: no configuration and speed has both a slow test and a step record with a standard error")
    say(f"{cases} stiffnesses shared with step records, {in_tension} in tension", quiet)
