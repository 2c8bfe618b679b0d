"""A figure in a notebook: a small picture, the same bytes each time, with the notes at its foot as text beside it."""

from io import BytesIO
from pathlib import Path

import matplotlib.style
from matplotlib.figure import Figure
from PIL import Image

from bayes_tyre.report.figures.page import layout

#: Dots an inch: a page of 8 inches is as wide as a notebook's column. So many colours keep every line's own exactly.
DOTS, COLOURS = 100, 256


class NotebookFigure:
    """A figure that notebooks show by themselves, whatever matplotlib backend they use.

    Attributes
    ----------
    figure:
        Of matplotlib, to change it further.
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure

    @matplotlib.style.context(layout.STYLE)
    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.figure.savefig(buffer, format="png", dpi=DOTS)
        return small_png(Image.open(buffer).convert("RGB"), COLOURS)

    def __repr__(self) -> str:
        # The notes stand at the foot from the last line to the first, then the origin: see `page.finish`.
        notes_and_corners = [text.get_text() for text in self.figure.texts if text.get_text()]
        notes = [line for line in notes_and_corners if not line.startswith(("data:", "verdict:"))]
        rest = [line for line in notes_and_corners if line not in notes]
        return "\n".join(["Figure.", *reversed(notes), *rest])

    def save(self, path: str | Path) -> Path:
        """Write it as PNG at 150 dots an inch, whole or not at all; return the path."""
        return layout.save(self.figure, Path(path))


def small_png(image: Image.Image, colours: int) -> bytes:
    """Return a picture as a small PNG, the same bytes each time."""
    small = BytesIO()
    image.quantize(colours).save(small, format="png", optimize=True)
    return small.getvalue()
