"""Figures drawn by a process of their own, while this one computes the next and writes files."""

import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from functools import partial

from bayes_tyre.report.figures.catalogue import Drawing
from bayes_tyre.report.figures.page.layout import page, png_file
from bayes_tyre.workflow.execution.executors import local_processes

#: Begins a drawing, and returns what gives the bytes of its PNG, or raises what the drawing raised.
type Begin = Callable[[Drawing], Callable[[], bytes]]
#: The bytes of a PNG, and the warnings of its drawing: text and category.
type Drawn = tuple[bytes, list[tuple[str, type[Warning]]]]


@contextmanager
def drawing_process(apart: bool) -> Iterator[Begin]:
    """Give what begins drawings: in a process of its own where `apart`, else here, each when its bytes are asked for.

    The process starts, and imports, at once. What it has not begun when its bytes are asked for is drawn here; so is
    what it did not draw, should it die or not start.
    """
    if not apart:
        yield lambda drawing: partial(png_file, drawing)
        return
    with local_processes(1).start() as pool:

        def begin(drawing: Drawing) -> Callable[[], bytes]:
            try:
                return partial(_drawn, drawing, pool.submit(_drawn_there, drawing))
            except (BrokenExecutor, OSError):
                return partial(png_file, drawing)

        begin(partial(page, 1.0, 1.0))  # imports what all figures need
        yield begin


def _drawn_there(drawing: Drawing) -> Drawn:
    """Return the bytes of a PNG, and its warnings: only the first process knows how they are shown."""
    with warnings.catch_warnings(record=True) as caught:
        drawn = png_file(drawing)
    return drawn, [(str(each.message), each.category) for each in caught]


def _drawn(drawing: Drawing, elsewhere: Future[Drawn]) -> bytes:
    if elsewhere.cancel():
        return png_file(drawing)
    try:
        drawn, warned = elsewhere.result()
    except BrokenExecutor:
        return png_file(drawing)
    for text, category in warned:
        warnings.warn(text, category, stacklevel=2)
    return drawn
