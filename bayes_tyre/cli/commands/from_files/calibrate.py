"""`calibrate`: lines from volts to engineering units, from a file that holds both."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli import suffixes
from bayes_tyre.cli.messages import LONGEST_LINE
from bayes_tyre.cli.shell import Quiet, say, warn
from bayes_tyre.plain_text import one_line

if TYPE_CHECKING:
    from bayes_tyre.workflow.calibrate import Fitted


def calibrate(
    raw: Annotated[Path, typer.Argument(metavar="RAW", help=f"Raw file ({suffixes.RAW}) with volts and units.")],
    rig: Annotated[
        str | None, typer.Option(help="Rig whose [channels] say which channel is which: single, dual, or a TOML file.")
    ] = None,
    mend_signs: Annotated[
        bool,
        typer.Option("--mend-signs", help="Restore lost minus signs where the readings then lie on a rising line."),
    ] = False,
    out: Annotated[Path | None, typer.Option(help="TOML file to write: the [calibration] section of a rig.")] = None,
    quiet: Quiet = False,
) -> None:
    """Fit the lines from volts to engineering units, m/s^2 and (mm, kN), by least squares over all rows of a file.

    Prints for each sensor slope (unit/V), intercept (unit), root mean square of the residuals, the digitiser's step,
    and rows used. A sensor whose pair of channels is missing, or constant, is named on stderr; with none, exit 3.
    A line that leaves more than three steps is named too, and whether lost minus signs are the cause.

    Example: bayes-tyre calibrate data/sample/appendix_b1.lvm --mend-signs --out calibration.toml
    """
    from bayes_tyre.workflow.calibrate import calibrate as fit_lines

    lines, notes = fit_lines(raw, rig, mend_signs, out)
    for text in notes:
        warn(text)
    if not quiet:
        _print(lines)
    mended = sum(fitted.mended for fitted in lines)
    if mended:
        say(f"{mended} minus signs restored", quiet)
    if out is not None:
        say(f"wrote {out}", quiet)


def _print(lines: Sequence["Fitted"]) -> None:
    from bayes_tyre.report.terminal.console import print_table

    numbers = ("slope", "intercept", "residual rms", "step, V", "step", "rows")
    of_numbers = [(name, {"justify": "right", "no_wrap": True}) for name in numbers]
    print_table([("sensor", {}), *of_numbers, ("channels", {"overflow": "fold"})], map(_cells, lines))


def _cells(fitted: "Fitted") -> list[str]:
    sensor, line, unit = fitted.sensor, fitted.line, fitted.sensor.unit
    return [
        sensor.quantity,
        f"{line.slope:.7g} {unit}/V",
        f"{line.intercept:.7g} {unit}",
        f"{fitted.residual_rms:.2g} {unit}",
        f"{fitted.volts_step:.4g}",
        f"{fitted.unit_step:.4g} {unit}",
        str(fitted.rows),
        one_line(f"{sensor.voltage} -> {sensor.channel}", LONGEST_LINE),
    ]
