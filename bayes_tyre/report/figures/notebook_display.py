"""A figure in a notebook: a small picture, the same bytes each time, with the notes at its foot as text beside it."""

from io import BytesIO
from pathlib import Path

import matplotlib.style
from matplotlib.figure import Figure
from PIL import Image

from bayes_tyre.errors import BadInput
from bayes_tyre.report.figures import layout
from bayes_tyre.report.figures.labels import origin_note
from bayes_tyre.results.provenance import RUN_JSON, read_run

#: Dots an inch: a page of 8 inches is as wide as a notebook's column. So many colours keep every line's own exactly.
DOTS, COLOURS = 100, 256
#: Of a figure that was drawn larger: made small its lines have shades, which more colours would keep, and few see.
KEPT_COLOURS = 64


class NotebookFigure:
    """A figure that notebooks show by themselves, whatever they are told about drawing.

    Attributes
    ----------
    figure:
        Of matplotlib, to change it further.
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure

    @matplotlib.style.context(layout.STYLE)
    def _repr_png_(self) -> bytes:
        kept = BytesIO()
        self.figure.savefig(kept, format="png", dpi=DOTS)
        return _png(Image.open(kept).convert("RGB"), COLOURS)

    def __repr__(self) -> str:
        # The notes stand at the foot from the last line to the first, then the origin: see `page.finish`.
        said = [text.get_text() for text in self.figure.texts if text.get_text()]
        notes = [line for line in said if not line.startswith(("data:", "verdict:"))]
        rest = [line for line in said if line not in notes]
        return "\n".join(["Figure.", *reversed(notes), *rest])

    def save(self, path: str | Path) -> Path:
        """Write it as PNG at 150 dots an inch, whole or not at all; return the path."""
        return layout.save(self.figure, Path(path))


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
        return _png(picture, KEPT_COLOURS)

    def __repr__(self) -> str:
        return f"Figure {self._path.stem}.\n{origin_note(self._origin)}"


def _png(picture: Image.Image, colours: int) -> bytes:
    """Return a picture as a small PNG, the same bytes each time."""
    small = BytesIO()
    picture.quantize(colours).save(small, format="png", optimize=True)
    return small.getvalue()
