"""A figure as it lies in the folder of a result, shown small in a notebook."""

from pathlib import Path

from PIL import Image

from bayes_tyre.errors import BadInput
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.labels import origin_note
from bayes_tyre.report.figures.page.notebook_display import DOTS, small_png
from bayes_tyre.results.provenance import RUN_JSON, read_run

#: Made small, its lines have shades, which more colours would keep, and few see.
COLOURS = 64


class StoredFigure:
    """A figure as it lies in the folder of a result, which notebooks show by themselves: nothing is drawn anew.

    Parameters
    ----------
    folder:
        That `fit` wrote.
    name:
        Of the figure, such as ``contrasts``.

    Raises
    ------
    BadInput
        If the folder holds no result of `fit`, or not this figure.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._path, self._origin = folder / "figures" / f"{name}.png", read_run(folder / RUN_JSON)["origin"]
        if not self._path.is_file():
            raise BadInput(f"{self._path}: no such figure; name one that lies in {self._path.parent}")

    def _repr_png_(self) -> bytes:
        picture = Image.open(self._path).convert("RGB")
        picture.thumbnail((round(layout.WIDTH * DOTS), round(layout.TALLEST * DOTS)))
        return small_png(picture, COLOURS)

    def __repr__(self) -> str:
        return f"Figure {self._path.stem}.\n{origin_note(self._origin)}"
