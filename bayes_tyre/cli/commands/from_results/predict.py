"""`predict`: force against displacement for a vehicle model, from a fit on disk."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from bayes_tyre.cli.shell import NOT_TRUSTED, Interval, Quiet, Seed, say, warn
from bayes_tyre.errors import BadInput

if TYPE_CHECKING:
    import numpy as np

    from bayes_tyre.record import Case
    from bayes_tyre.results.cases.selection import CaseQuery

MOST_POINTS, FARTHEST_MM = 100_000, 1e6


def predict(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folder that fit wrote; with --weights all folders that were compared."),
    ],
    case: Annotated[
        list[str] | None,
        typer.Option(
            help="Label of a case, 'single (0)30-20', or factors, configuration=single,speed_km_h=0; may be repeated. "
            "Factors select every case that has them all (of a factor given twice, either value). The opposite "
            "direction is included, unless the factor direction is given. A speed, load or step that was not tested is "
            "predicted from those that were: speed_km_h=20."
        ),
    ] = None,
    displacement: Annotated[
        str | None,
        typer.Option(
            help="mm from the start of the step: LOW:HIGH:POINTS or d1,d2,... Without a negative number for both "
            "directions; else loading takes the positive ones, unloading the negative. Default: 101 points as "
            "far as the case's records go."
        ),
    ] = None,
    of: Annotated[
        Literal["case", "repeat"],
        typer.Option(help="The mean curve of the case; or one more repeat, its deviation and noise included."),
    ] = "case",
    weights: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Folder that compare wrote, or one of its tables: what its models predict together, each with its "
            "stacking weight.",
        ),
    ] = None,
    interval: Interval = 0.95,
    out: Annotated[
        Path | None, typer.Option(help="Folder, or a .csv file; default: DIR, with --weights that of the comparison.")
    ] = None,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Predict force (kN) against displacement (mm) of a case, loading and unloading: curves for a vehicle model.

    Writes prediction.csv (a row a point: median, lower, upper) and prediction.toml (k, beta, J, C, F_i of each case:
    kN/mm, mm, kN). displacement_mm counts from the start of the step, positive in loading, negative in unloading.

    Example: bayes-tyre predict results/fit --case 'single (0)30-20' --displacement 0:4:81
    """
    grid = _grid(displacement) if displacement is not None else None
    if weights is None and len(folders) > 1:
        raise typer.BadParameter(
            "of several fits each has a weight; name the folder that compare wrote of them", param_hint="--weights"
        )
    from bayes_tyre.workflow.from_results.predict import answers, read_stack, single_fit, target, write_prediction

    stack = single_fit(folders[0]) if weights is None else read_stack(folders, weights)
    query = _query(case or [], stack.first.cases)
    compared = weights if weights is None or weights.is_dir() else weights.parent
    destination = target(compared or folders[0], out)
    prediction, paths = write_prediction(
        stack, query, destination, displacement_mm=grid, of=of, interval=interval, seed=seed
    )
    for text in (*answers(prediction.curves), *prediction.warnings):
        say(text, quiet)
    for path in paths:
        say(f"wrote {path} (data: {stack.first.tree.attrs['origin']}, verdict {stack.verdict})", quiet)
    if stack.failed:
        reasons = ", ".join(map(str, stack.failed))
        subject = "the posterior is" if len(stack.results) == 1 else "these models are"
        warn(f"{subject} not to be trusted, nor is the prediction; {reasons} gives the reason")
        raise typer.Exit(NOT_TRUSTED)


def _query(texts: list[str], cases: list["Case"]) -> "CaseQuery":
    """Return the query that --case states; no text, or text that cannot be parsed, is a usage error."""
    from bayes_tyre.results.cases.selection import case_list, parse_query

    if not any(text.strip() for text in texts):
        labels = [case.label for case in cases]
        raise typer.BadParameter(f"name a case; there are {len(cases)}: {case_list(labels)}", param_hint="--case")
    try:
        return parse_query(texts, cases)
    except BadInput as error:
        raise typer.BadParameter(str(error), param_hint="--case") from None


def _grid(text: str) -> "np.ndarray":
    """Return the displacements (mm) that LOW:HIGH:POINTS or d1,d2,... mean; anything else is a usage error."""
    import numpy as np

    def usage_error(problem: str) -> typer.BadParameter:
        return typer.BadParameter(
            f"{text[:60]!r} {problem}; use LOW:HIGH:POINTS, such as 0:4:81, or d1,d2,...", param_hint="--displacement"
        )

    try:
        if ":" in text:
            low, high, points = text.split(":")
            low, high, count = float(low), float(high), int(points)
        else:
            values = np.array([float(number) for number in text.split(",")])
            low, high, count = float(values.min()), float(values.max()), len(values)
    except ValueError:
        raise usage_error("is not a grid of numbers") from None
    if not (abs(low) <= FARTHEST_MM and abs(high) <= FARTHEST_MM):  # refuses NaN too
        raise usage_error(f"reaches beyond {FARTHEST_MM:g} mm")
    if count > MOST_POINTS:
        raise usage_error(f"has more than {MOST_POINTS} points")
    if ":" not in text:
        return values
    if count < 2 or low >= high:
        raise usage_error("does not rise from LOW to HIGH in 2 points or more")
    return np.linspace(low, high, count)
