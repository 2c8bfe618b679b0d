"""What goes to which stream, and how: results on stdout; faults and warnings on stderr, one line each."""

import io
import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

#: Warnings about code, not about data: who runs a command cannot act on them.
_FOR_DEVELOPERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning)


def one_line(text: object) -> str:
    """Return a text in one line, with escapes for what would steer a terminal or turn its writing round."""
    line = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line)


def say(text: str, quiet: bool) -> None:
    """Print on stdout, unless quiet."""
    if not quiet:
        typer.echo(text)


def note(text: object, quiet: bool) -> None:
    """Print on stderr, one line, what a command does beside what was asked, unless quiet."""
    if not quiet:
        typer.echo(f"bayes-tyre: {one_line(text)}", err=True)


def fault(text: object) -> None:
    """Print on stderr, one line, what ended a command or why its result is not to be trusted."""
    typer.echo(f"bayes-tyre: {one_line(text)}", err=True)


def warn(text: object) -> None:
    """Print a warning on stderr, one line, quiet or not."""
    fault(f"warning: {one_line(text)}")


class _Warn(logging.Handler):
    """What libraries log, told like every other warning."""

    def __init__(self, said: set[str]) -> None:
        super().__init__(logging.WARNING)
        self.said = said

    def emit(self, record: logging.LogRecord) -> None:
        # What JAX logs below an error, such as a GPU that it does not use, needs nobody's attention.
        if record.name.split(".")[0] != "jax" or record.levelno >= logging.ERROR:
            _warn_once(record.getMessage(), self.said)


def _warn_once(text: str, said: set[str]) -> None:
    if text not in said:
        said.add(text)
        warn(text)


@contextmanager
def one_line_each() -> Iterator[None]:
    """Tell the warnings of the block, Python's and those that libraries log, once each and in one line."""
    said: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if not issubclass(category, _FOR_DEVELOPERS):
            _warn_once(str(message), said)

    for stream in (sys.stdout, sys.stderr):  # a label or a path that the terminal cannot show is shown by its codes
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    handler, root = _Warn(said), logging.getLogger()
    root.addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = show
            # JAX compiles what it could not read there, and goes on without what it could not write.
            warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache entry")
            yield
    finally:
        root.removeHandler(handler)
