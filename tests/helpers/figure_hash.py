"""A figure's perceptual hash: how much ink lies in each cell of a grid, which fonts' edges hardly move.

Not the comparison of `matplotlib.testing`: the root mean square difference of these figures with other edges of letters
is 10 to 15 of 255, that of a figure without one of its curves 6, without an interval 14. No limit lies between them.

`PYTHONPATH=tests:notebooks python -m helpers.figure_hash` draws the figures and writes `figure_hashes.json`: run it
after an intended change, when you have looked at the figures.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib.style
import numpy as np
from helpers.audit_made_up import audited, blind
from helpers.drawings import drawn
from helpers.hand_made_posteriors import motion_cases
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from support.motion_figures import loop_figure
from support.motion_truth import true_loop

from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.report.figures import motion as motion_figures
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import STYLE
from bayes_tyre.results.figure_data.hysteresis_loops import friction_loops

STORED = Path(__file__).parents[1] / "report" / "figures" / "figure_hashes.json"
#: Cells a side; share of ink that is the darkest level, thin lines being what counts; levels.
SIDE, FULL, LEVELS = 32, 0.25, 16
#: A cell has changed by so many levels; so many cells may.
CHANGED, MOST = 3, 3


def figure_hash(figure: Figure) -> str:
    """Return the hash: a hexadecimal digit a cell, row by row."""
    canvas = FigureCanvasAgg(figure)
    with matplotlib.style.context(STYLE):
        canvas.draw()
    colours = np.asarray(canvas.buffer_rgba(), dtype=float)[..., :3] / 255
    ink = 1 - colours @ [0.299, 0.587, 0.114]
    level = np.round((LEVELS - 1) * np.minimum(1.0, _cells(ink) / FULL)).astype(int)
    return "".join(f"{value:x}" for value in level.ravel())


def _cells(ink: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "side side"]:
    """Return the mean ink of each cell; a pixel on an edge belongs to both cells by its shares."""
    for axis in (0, 1):
        total = np.insert(np.cumsum(ink, axis=axis), 0, 0.0, axis=axis)
        at = np.linspace(0, ink.shape[axis], SIDE + 1)
        whole = np.arange(total.shape[axis])
        edges = np.apply_along_axis(lambda of, at=at, whole=whole: np.interp(at, whole, of), axis, total)
        ink = np.diff(edges, axis=axis) / (at[1] - at[0])
    return ink


def distance(one: str, other: str) -> int:
    """Return how many cells differ by `CHANGED` levels or more."""
    levels = [np.array([int(digit, 16) for digit in text]) for text in (one, other)]
    return int((np.abs(levels[0] - levels[1]) >= CHANGED).sum())


def loops() -> Figure:
    return motion_figures.loops_by_direction(friction_loops(motion_cases()), Setting("simulated"), 2.0)


def loop() -> Figure:
    path = true_loop(1.8, 0.45, 0.08, 2.0).rename(columns={"median_kN": "friction_kN"})
    return loop_figure(path.assign(force_kN=1.8 * path["displacement_mm"] + path["friction_kN"]), 2.0)


def audit() -> Figure:
    return audit_figures.beta_returned(audited(blind).table, 801)


def of_tables(name: str) -> Callable[[], Figure]:
    return lambda: drawn.__wrapped__(name)


TABLES = ("posteriors_by_direction", "forest_of_cases", "contrasts", "outlier_probabilities")
FIGURES: Mapping[str, Callable[[], Figure]] = {
    **{name: of_tables(name) for name in TABLES},
    **{"loops_by_direction": loops, "loop_figure": loop, "beta_returned": audit},
}


if __name__ == "__main__":
    written = {name: figure_hash(draw()) for name, draw in FIGURES.items()}
    STORED.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
