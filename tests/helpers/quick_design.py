"""A design small enough to be fitted in a test."""

from bayes_tyre.record import Case
from bayes_tyre.studies.design import Design, design


def quick_design() -> Design:
    """Return 4 cases x 3 repeats x 20 points: cells, speed, remainders, scatter by speed, discordant repeats."""
    cases = [
        Case("single", direction, speed, 20.0, step)
        for direction, step in (("loading", 10.0), ("unloading", -10.0))
        for speed in (0.0, 25.0)
    ]
    return design(cases, repeats=3, points=20)
