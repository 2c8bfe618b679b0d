"""Figures drawn by a process of their own are those drawn here, and none is lost with it."""

import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial

import pytest

from bayes_tyre.report.figures.page.layout import page, png_file
from bayes_tyre.workflow import drawing
from bayes_tyre.workflow.drawing import drawing_process
from bayes_tyre.workflow.execution.executors import Executors

EMPTY = partial(page, 2.0, 1.0)


def test_another_process_draws_the_same_bytes_and_hands_on_what_was_raised():
    with drawing_process(apart=True) as begin:
        drawn, failed = begin(EMPTY), begin(partial(int, "no number"))  # pyright: ignore[reportArgumentType]
        assert drawn() == png_file(EMPTY)
        with pytest.raises(ValueError, match="no number"):
            failed()


class Dead(Executor):
    """A pool whose process has died: before it was asked, or after."""

    def __init__(self, at_once: bool) -> None:
        self.at_once = at_once

    def submit(self, *_: object) -> Future[bytes]:  # pyright: ignore[reportIncompatibleMethodOverride]
        if self.at_once:
            raise BrokenProcessPool
        future: Future[bytes] = Future()
        future.set_exception(BrokenProcessPool())
        return future


@pytest.mark.parametrize("at_once", [True, False])
def test_what_a_dead_process_did_not_draw_is_drawn_here(at_once, monkeypatch):
    @contextmanager
    def start() -> Iterator[Dead]:
        yield Dead(at_once)

    monkeypatch.setattr(drawing, "local_processes", lambda _: Executors(start, lambda: 1))
    with drawing_process(apart=True) as begin:
        assert begin(EMPTY)() == png_file(EMPTY)


def test_what_another_process_has_not_begun_is_drawn_here():
    waiting = Future[drawing.Drawn]()
    assert drawing._drawn(EMPTY, waiting) == png_file(EMPTY)
    assert waiting.cancelled()


def test_warnings_of_another_process_are_given_here():
    there = Future[drawing.Drawn]()
    there.set_result((b"drawn", [("no glyph", UserWarning)]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert drawing._drawn(EMPTY, there) == b"drawn"
    assert [(str(each.message), each.category) for each in caught] == [("no glyph", UserWarning)]
