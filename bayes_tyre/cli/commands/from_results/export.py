"""`export`: files for a vehicle simulator, from a result on disk."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from bayes_tyre.cli.shell import NOT_TRUSTED, Out, Quiet, say, warn
from bayes_tyre.plain_text import listed
from bayes_tyre.runtime import prepare_jax

#: Formats of files that hold values without a curve; and radii that a tyre may have, mm: from a kart's to a dumper's.
WITHOUT_CURVE, RADII_MM = ("tir", "modelica"), (50.0, 2500.0)


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit, motion or load-deflection wrote.")],
    to: Annotated[
        Literal["tir", "tydex", "modelica", "csv-spline"],
        typer.Option(
            help="tir: tyre property file (N/m, N s/m, m); tydex: TYDEX 1.3 file of the fitted curve (m, N); modelica: "
            "record, and table for CombiTable1D (m, N); csv-spline: deflection (mm), force (N), for Adams or Simpack."
        ),
    ],
    out: Out,
    quantiles: Annotated[
        str | None,
        typer.Option(help="Quantiles of the posterior, such as 0.025,0.975: a further file of each case for each."),
    ] = None,
    unloaded_radius_mm: Annotated[
        float | None, typer.Option(help="Unloaded radius of the tyre (mm), for --to tir: no result holds it.")
    ] = None,
    case: Annotated[
        list[str] | None,
        typer.Option(
            help="Cases to export, all without it: a label, 'single (0)30-20', or factors, "
            "configuration=single,speed_km_h=0; may be repeated."
        ),
    ] = None,
    means: Annotated[
        bool,
        typer.Option(
            "--means",
            help="A file for the mean over the cases of each configuration and direction, the values that fit prints, "
            "in place of a file a case: for tir and modelica.",
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write k (kN/mm in the result) and force curves for a vehicle simulator: a file a case, in its units.

    Values are medians. Comments in each file give the 95 % intervals, the origin of the data, the verdict, and what
    the format cannot hold, such as hysteresis. What a result does not know is left out: damping is known from motion
    alone, a curve from first touch from load-deflection alone. Ends with code 4 where the verdict is fail.

    Example: bayes-tyre export results/fit --to tir --out results/tir --unloaded-radius-mm 498.7
    """
    levels = _quantiles(quantiles)
    if unloaded_radius_mm is not None:
        _check_radius(unloaded_radius_mm, to)
    if means and case:
        raise typer.BadParameter("means are over all cases; leave --case out", param_hint="--means")
    if means and to not in WITHOUT_CURVE:
        raise typer.BadParameter(f"a mean has no curve; use --to {' or '.join(WITHOUT_CURVE)}", param_hint="--means")
    prepare_jax()
    from bayes_tyre.workflow.from_results.export import not_in_tir, write_export

    exported, paths = write_export(
        folder, to, out, quantiles=levels, radius_mm=unloaded_radius_mm, cases=case or (), means=means
    )
    verdict = f", verdict {exported.verdict}" if exported.verdict else ""
    names = listed([path.name for path in paths], 3)
    say(f"wrote {len(paths)} files to {out} (data: {exported.origin}{verdict}): {names}", quiet)
    k = [model.parameters["k"] for model in exported.models]
    low, high = (bound(parameter.value for parameter in k) for bound in (min, max))
    of = "means" if means else "cases"
    say(f"k of {len(k)} {of}: {low:.4g} to {high:.4g} {k[0].unit}; each file states its 95 % interval", quiet)
    for text in exported.notes:
        say(text, quiet)
    if exported.verdict and len(k) > 1 and not means:  # load-deflection has no means
        say("use the case nearest to what you simulate, or the means over cases: --means", quiet)
    if to == "tir":
        for key, reason in not_in_tir(exported.models[0], unloaded_radius_mm).items():
            say(f"not in the files: {key}: {reason}", quiet)
    if exported.verdict == "fail":
        warn(f"the posterior is not to be trusted; {folder / 'diagnostics.json'} gives the reason")
        raise typer.Exit(NOT_TRUSTED)


def _check_radius(radius_mm: float, to: str) -> None:
    if to != "tir":
        raise typer.BadParameter(f"{to} has no place for it; leave it out", param_hint="--unloaded-radius-mm")
    if not RADII_MM[0] <= radius_mm <= RADII_MM[1]:
        raise typer.BadParameter(
            f"{radius_mm:g} mm is the radius of no tyre; give mm, such as 498.7", param_hint="--unloaded-radius-mm"
        )


def _quantiles(text: str | None) -> list[float]:
    """Return the quantiles that q1,q2,... means; anything else is a usage error."""
    try:
        levels = [float(part) for part in text.split(",")] if text is not None else []
    except ValueError:
        levels = [0.0]
    if not all(0 < level < 1 and level != 0.5 for level in levels):
        raise typer.BadParameter("use numbers between 0 and 1, such as 0.025,0.975", param_hint="--quantiles")
    return list(dict.fromkeys(levels))
