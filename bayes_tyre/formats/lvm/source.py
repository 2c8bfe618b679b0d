"""The bytes of a text file, and errors that name a line of it."""

from pathlib import Path
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import quoted

#: More columns than any recorder has; a line with more is another kind of file.
MOST_COLUMNS = 10_000


class Source(NamedTuple):
    """A file and its bytes; lines end with a line feed, or a carriage return and one."""

    path: Path
    data: bytes

    def fault(self, at: int, what: str) -> BadInput:
        """Return the error that names the line at this byte; `what` says what is wrong and what to do."""
        return self.fault_in_line(self.data.count(b"\n", 0, at) + 1, what)

    def fault_in_line(self, line: int, what: str, column: str = "") -> BadInput:
        """Return the error that names this line, counted from 1, and the column if one is given."""
        where = f", column {column if column.isprintable() and len(column) <= 60 else quoted(column)}" if column else ""
        return BadInput(f"{self.path}: line {line}{where}: {what}")

    def line(self, at: int) -> tuple[bytes, int]:
        """Return the line that begins at this byte, without its end, and where the next one begins."""
        stop = self.data.find(b"\n", at)
        stop = len(self.data) if stop < 0 else stop
        return self.data[at:stop].rstrip(b"\r"), min(stop + 1, len(self.data))


def as_text(data: bytes) -> str:
    """Return bytes as text: UTF-8, or Latin-1 where they are not."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")
