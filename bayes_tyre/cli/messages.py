"""Results go to stdout; faults and warnings go to stderr, one line each."""

import io
import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from bayes_tyre.plain_text import one_line

LOGGER = logging.getLogger("bayes_tyre")
#: Most characters of a printed line.
LONGEST_LINE = 10_000
#: Warnings about code, not about data: the user of a command cannot act on them.
_FOR_DEVELOPERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning)


def say(text: str, quiet: bool) -> None:
    """Print on stdout, unless quiet."""
    LOGGER.debug("%s", text)
    if not quiet:
        typer.echo(text)


def note(text: object, quiet: bool) -> None:
    """Print a note on how a command runs, in one line on stderr, unless quiet."""
    if not quiet:
        fault(text)


def fault(text: object) -> None:
    """Print in one line on stderr what ended a command, or why its result is not to be trusted."""
    line = one_line(text, LONGEST_LINE)
    LOGGER.debug("%s", line, exc_info=sys.exc_info()[0] is not None)
    typer.echo(f"bayes-tyre: {line}", err=True)


def warn(text: object) -> None:
    """Print a warning on stderr, one line, quiet or not."""
    fault(f"warning: {text}")


class _WarningHandler(logging.Handler):
    """Print the log messages of libraries as warnings."""

    def __init__(self, printed: set[str]) -> None:
        super().__init__(logging.WARNING)
        self.printed = printed

    def emit(self, record: logging.LogRecord) -> None:
        # What JAX logs below an error, such as a GPU that it does not use, is of no use to the user.
        if record.name.split(".")[0] != "jax" or record.levelno >= logging.ERROR:
            _warn_once(record.getMessage(), self.printed)


def _warn_once(text: str, printed: set[str]) -> None:
    if text not in printed:
        printed.add(text)
        warn(text)


@contextmanager
def one_line_each() -> Iterator[None]:
    """Print the warnings of the block, Python's and those that libraries log, once each and in one line."""
    printed: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if not issubclass(category, _FOR_DEVELOPERS):
            _warn_once(str(message), printed)

    for stream in (sys.stdout, sys.stderr):  # characters that the terminal cannot show become escapes
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    handler, root = _WarningHandler(printed), logging.getLogger()
    root.addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = show
            # JAX then compiles anew, or continues without writing the entry.
            warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache entry")
            yield
    finally:
        root.removeHandler(handler)
