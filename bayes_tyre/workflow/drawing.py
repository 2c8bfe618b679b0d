"""Figures drawn by a process of their own, while this one computes the next and writes files."""

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from functools import partial

from bayes_tyre.report.figures.catalogue import Drawing
from bayes_tyre.report.figures.page.layout import page, png_file
from bayes_tyre.workflow.execution.executors import local_processes

#: Begins a drawing, and returns what gives the bytes of its PNG, or raises what the drawing raised.
type Begin = Callable[[Drawing], Callable[[], bytes]]


@contextmanager
def drawing_process(apart: bool) -> Iterator[Begin]:
    """Give what begins drawings: in a process of its own where `apart`, else here, each when its bytes are asked for.

    The process starts, and imports, at once. Should it die, or not start, what it did not draw is drawn here.
    """
    if not apart:
        yield lambda drawing: partial(png_file, drawing)
        return
    with local_processes(1).start() as pool:

        def begin(drawing: Drawing) -> Callable[[], bytes]:
            try:
                return partial(_drawn, drawing, pool.submit(png_file, drawing).result)
            except (BrokenExecutor, OSError):
                return partial(png_file, drawing)

        begin(partial(page, 1.0, 1.0))  # imports what all figures need
        yield begin


def _drawn(drawing: Drawing, elsewhere: Callable[[], bytes]) -> bytes:
    try:
        return elsewhere()
    except BrokenExecutor:
        return png_file(drawing)
