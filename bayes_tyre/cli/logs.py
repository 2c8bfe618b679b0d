"""What a command did, and when: on stderr with --verbose, and in a file with --log-file.

Everything that commands print, and every stage that begins, goes through the logger `bayes_tyre`.
"""

import logging
import os
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.messages import LOGGER, fault
from bayes_tyre.plain_text import one_line

Verbose = Annotated[bool, typer.Option("--verbose", help="Print each stage of the work, and when it began, on stderr.")]
LogFile = Annotated[
    Path | None,
    typer.Option(
        "--log-file",
        metavar="FILE",
        help="Add what is printed, each stage, and where an error arose, with date and time, to this file.",
    ),
]


class _Stages(logging.Handler):
    """Print stages on stderr, each with the seconds since the command began."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.began = time.time()

    def emit(self, record: logging.LogRecord) -> None:
        typer.echo(f"bayes-tyre: {record.created - self.began:7.1f} s  {record.getMessage()}", err=True)


@contextmanager
def logging_to(verbose: bool, log_file: Path | None) -> Iterator[None]:
    """Log while the block runs: stages on stderr if `verbose`; stages and everything printed in `log_file`.

    If the file cannot be written, the command ends with code 3.
    """
    handlers: list[logging.Handler] = [_Stages()] if verbose else []
    if log_file is not None:
        handlers.append(_file_handler(log_file))
    previous_level, began, process_id = LOGGER.level, time.monotonic(), os.getpid()
    LOGGER.setLevel(logging.DEBUG)
    for handler in handlers:
        LOGGER.addHandler(handler)
    code: object = 0
    try:
        LOGGER.debug("bayes-tyre %s, Python %s", version("bayes-tyre"), sys.version.split()[0])
        LOGGER.debug("command: %s", one_line(shlex.join(["bayes-tyre", *sys.argv[1:]]), None))
        yield
    except typer.Exit as end:
        code = end.exit_code
        raise
    except BaseException as error:
        code = type(error).__name__
        raise
    finally:
        if os.getpid() == process_id:  # with limited memory a command runs in a child: only the parent logs its end
            LOGGER.info("ended with code %s after %.1f s", code, time.monotonic() - began)
        for handler in handlers:
            LOGGER.removeHandler(handler)
            handler.close()
        LOGGER.setLevel(previous_level)


def _file_handler(path: Path) -> logging.Handler:
    """Open a file at once, and return a handler that appends to it."""
    try:
        handler = logging.FileHandler(path, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        fault(f"--log-file {path}: {error.strerror or error}; name a file that can be written")
        raise typer.Exit(3) from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    return handler
