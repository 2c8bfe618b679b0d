"""`modes`: a flexible ring on an elastic foundation, fitted to measured natural frequencies."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli import suffixes
from bayes_tyre.cli.shell import NOT_TRUSTED, Interval, Out, Quiet, Seed, fault, say
from bayes_tyre.runtime import prepare_jax


def modes(
    table: Annotated[
        Path,
        typer.Argument(
            help=f"Table ({suffixes.TABLE}): mode (waves around the tyre: 1 moves the belt as a whole, 0 turns it "
            "about the rim), frequency_Hz; optional standard_deviation_Hz, pressure_bar, speed_km_h, wave (forward or "
            "backward, of a rolling tyre), origin."
        ),
    ],
    out: Out,
    mass_per_length: Annotated[
        float | None, typer.Option(min=0.001, help="Mass of the belt per length, kg/m; with --radius.")
    ] = None,
    radius: Annotated[
        float | None, typer.Option(min=1.0, help="Radius of the belt, mm; a rolling tyre needs it.")
    ] = None,
    motion: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder that motion --law rigid_ring wrote of the same tyre: its first mode is fitted too.",
        ),
    ] = None,
    configuration: Annotated[
        str | None, typer.Option(metavar="LABEL", help="Configuration of --motion; needed where it has several.")
    ] = None,
    interval: Interval = 0.95,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Fit a flexible ring on an elastic foundation to the natural frequencies (Hz) of a tyre.

    Frequencies determine bending stiffness EI, belt tension T and the sidewalls' radial and tangential stiffness k_w
    and k_v per mass of the belt alone (1/s^2); with --mass-per-length and --radius they are in kN mm^2, kN and kN/mm^2
    (per length of the belt). With pressure_bar T is proportional to pressure. speed_km_h turns the ring: each mode from
    2 on has a forward and a backward wave, their frequencies as seen from the ground. --motion adds mode 1 from the
    motion of the axle: that of the belt on its sidewall, without contact with the road.

    Writes modes.csv, a row a parameter (status says what is not identified), frequencies.csv, run.json and figures/.
    Ends with code 4 where the frequencies contradict the ring, given their standard deviations.

    Example: bayes-tyre modes modes_of_a_tyre.csv --out results/modes --mass-per-length 10 --radius 500
    """
    if mass_per_length is not None and radius is None:
        raise typer.BadParameter("needs the radius of the belt beside it; give --radius in mm", param_hint="--radius")
    if configuration is not None and motion is None:
        raise typer.BadParameter("is of --motion; give its folder, or leave it out", param_hint="--configuration")
    prepare_jax()
    from bayes_tyre.results.flexible_ring import parameter_lines
    from bayes_tyre.workflow.modes import Belt, Motion, fit_modes

    belt = Belt(radius, mass_per_length)
    axle_motion = None if motion is None else Motion(motion, configuration)
    parameters, fit = fit_modes(table, out, belt, sys.argv[1:], motion=axle_motion, interval=interval, seed=seed)
    for line in parameter_lines(parameters):
        say(line, quiet)
    say(f"wrote {out}: verdict {fit.verdict} (data: {parameters['origin'].iloc[0]})", quiet)
    if not any(check.name == "ring" for check in fit.checks):
        say(
            "note: whether the tyre is such a ring was not tested: that takes more modes, with standard deviations",
            quiet,
        )
    for check in (check for check in fit.checks if not check.passed):
        fault(check.reason)
    if fit.verdict != "pass":
        raise typer.Exit(NOT_TRUSTED)
