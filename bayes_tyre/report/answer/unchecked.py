"""What no check of a fit can find, because every record shares it, and what it would do to k."""

from typing import NamedTuple

from bayes_tyre.report.answer.formatting import PERCENT
from bayes_tyre.report.answer.load import Reported


class Unchecked(NamedTuple):
    """What was not checked, and what an error in it would do to k and beta."""

    what: str
    effect: str


#: What the records do not show unless a column says which of them share it, by the option that names the column; and
#: what that option does.
_LEVELS = {
    "specimen": (
        Unchecked(
            "Other tyres of a type",
            "The intervals are of the tyres that were tested, not of all tyres of their type.",
        ),
        " fit --specimen COLUMN, with a column that says which tyre each record was made on, puts into them what tyres "
        "differ by.",
    ),
    "day": (
        Unchecked(
            "Another day, or the tyre mounted again",
            "Repeats made one after the other agree better than a test reproduces.",
        ),
        " fit --day COLUMN, with a column that says the day or the mounting of each record, puts into the intervals "
        "what days differ by.",
    ),
}


def unchecked(result: Reported) -> list[Unchecked]:
    """Return what the records cannot show of themselves: calibration, processing, smoothing."""
    one = f"1{PERCENT}"
    force = f"A force that is {one} too large makes k, C and J {one} too large. Ratios on one rig stay the same."
    gauge = f"A gauge that reads {one} too much makes k {one} too small and beta {one} too large. Ratios stay the same."
    if result.of_motions:
        gauge = (
            f"An arm to laser and accelerometer that is {one} longer than stated makes k, m and c {one} too small and "
            f"beta {one} too large. A laser alone that reads {one} too much makes k, x and m too small by much of "
            "that, and a status of most records reports it. Ratios stay the same."
        )
    rows = [
        Unchecked("Lever arms and the load cell's factor", force + _in_intervals(result, "force_scale_sd")),
        Unchecked("The displacement gauge", gauge + _in_intervals(result, "displacement_scale_sd")),
    ]
    if "published" in result.origins:  # of printed numbers the caveats say it
        return rows
    shared = [both for level, both in _LEVELS.items() if not result.run["options"].get(level)]
    if result.of_motions:  # motion has no such options
        return [*rows, *(row for row, _ in shared)]
    rows += [row._replace(effect=row.effect + remedy) for row, remedy in shared]
    return [
        *rows,
        Unchecked(
            "Processing",
            "Inertia of the axle that was left out, or a wrong mass, is in the records: it changes k and beta with the "
            "duration of the step. bayes-tyre audit measures how much on simulated records. Only where a table says "
            "how well the mass is known (mass_sd_kg, force_per_kg_kN), as that of process does, is its error in the "
            "intervals.",
        ),
        Unchecked(
            "Smoothing",
            "With a filter longer than the response, beta is a length of the filter. k changes little where the travel "
            "is much longer than beta.",
        ),
    ]


def _in_intervals(result: Reported, option: str) -> str:
    """Return which error the fit was told to expect, as a sentence to go on with; nothing where it was told none."""
    sd = result.run["options"].get(option)
    if isinstance(sd, int | float) and sd > 0:
        return f" An error with a standard deviation of {100 * sd:g}{PERCENT} is in the intervals, no larger one."
    return ""
