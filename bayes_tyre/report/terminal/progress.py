"""How far long work is: one bar a stage on stderr, with the time that remains of it."""

import logging
import sys
from collections.abc import Callable
from typing import Any


class Stages:
    """The bars of a command or a function, one after the other; nothing where no one would see them.

    Parameters
    ----------
    shown:
        Whether to draw them. They need a terminal, or a notebook: elsewhere, none is drawn.
    """

    def __init__(self, shown: bool = True) -> None:
        self._new = _new_bar(shown)
        self._bar: Any = None
        self._name, self._left = "", 0

    def begin(self, name: str, total: int | None = None) -> None:
        """Begin a stage: its bar takes the place of the last one's."""
        self.stop()
        logging.getLogger("bayes_tyre").info("%s", name)
        if self._new is not None:
            self._bar = self._new(name, total)
            self._name, self._left = name, total or 0

    def advance(self, done: int) -> None:
        """Say how much more of the stage is done; what follows the last count has no full bar, but its seconds."""
        if self._bar is None:
            return
        self._bar.update(done)
        before, self._left = self._left, self._left - done
        if self._new is not None and before > 0 >= self._left:
            self._bar.close()
            self._bar = self._new(f"{self._name}: finishing", None)

    def stop(self) -> None:
        """Take the bar away, so that something can be printed."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def __enter__(self) -> "Stages":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Take the last bar away."""
        self.stop()


class _TerminalBar:
    """Rich's bar, which goes on counting seconds while nothing is done, with the methods of tqdm's."""

    def __init__(self, name: str, total: int | None) -> None:
        from rich import progress
        from rich.console import Console

        columns = [progress.TextColumn("{task.description}"), progress.BarColumn(), progress.TimeElapsedColumn()]
        if total is not None:  # as counts: a share is rounded to 100 % before the end
            columns[2:] = [progress.MofNCompleteColumn(), progress.TimeRemainingColumn()]
        self._bars = progress.Progress(*columns, console=Console(stderr=True), transient=True)
        self._bars.start()
        self._task = self._bars.add_task(name, total=total)

    def update(self, done: int) -> None:
        self._bars.advance(self._task, done)

    def close(self) -> None:
        self._bars.stop()


def _new_bar(shown: bool) -> Callable[[str, int | None], Any] | None:
    """Return what makes a bar; None where none is to be seen."""
    if shown and sys.stderr.isatty():
        return _TerminalBar
    return _notebook_bar if shown and _in_notebook() else None


def _in_notebook() -> bool:
    """Return whether this is the kernel of a notebook."""
    return "ipykernel" in sys.modules and "IPython" in sys.modules and sys.modules["IPython"].get_ipython() is not None


def _notebook_bar(name: str, total: int | None) -> Any:
    """Return tqdm's bar of text: its bar of widgets, and rich's too, need a package that not all have."""
    from tqdm import tqdm

    layout = "{desc} {elapsed}" if total is None else "{desc} |{bar:30}| {n_fmt}/{total_fmt}, {remaining} left"
    return tqdm(total=total, desc=name, leave=False, bar_format=layout)
