"""Text from files and libraries made safe to show, on one line, printable, not too long; or read as a number."""

import re
import shlex
import shutil
import sys
import textwrap
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

#: Most characters of a label in a table, of a name in a message, and of a library's error; most names in a list.
LABEL, NAME, REASON, LISTED = 30, 60, 200, 6
_COMMENT = 76
_PROGRAM = "bayes-tyre"
#: White space but the plain space.
_BREAKS = re.compile(r"[^\S ]+")


def one_line(text: object, most: int | None = LABEL) -> str:
    """Return a text as one line of at most `most` characters, each unprintable one replaced by U+FFFD.

    With `most` None, as for a path, nothing is shortened and spaces are left alone.
    """
    line = str(text) if most is None else _without_breaks(text)
    line = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)
    return line if most is None or len(line) <= most else f"{line[: most - 1]}\N{HORIZONTAL ELLIPSIS}"


def number_in(text: str | bytes) -> float | None:
    """Return the number that a text is, which may be infinite or NaN; None where it is none.

    Underscores between digits, and digits of other scripts, are Python's alone.
    """
    plain = text.decode("latin-1") if isinstance(text, bytes) else text
    if "_" in plain or not plain.strip().isascii():
        return None
    try:
        return float(text)
    except ValueError:
        return None


def reason(error: object) -> str:
    """Return a library's error as one line for a message: its text, or its kind where it has none."""
    return one_line(_without_breaks(error)[:REASON], None) or type(error).__name__


def quoted(text: str) -> str:
    """Return a text in quotes for a message, unprintable characters escaped, at most about `NAME` characters."""
    return repr(text if len(text) <= NAME else text[: NAME - 3] + "...")


def escaped(text: object, shows: Callable[[str], bool] = str.isprintable) -> str:
    """Return a text as one line, with escapes for the characters that `shows` refuses."""
    return "".join(c if shows(c) else c.encode("unicode_escape").decode("ascii") for c in _without_breaks(text))


def ascii_line(text: object) -> str:
    """Return a text as one line of printable ASCII, with escapes for all other characters."""
    return escaped(text, lambda c: c.isascii() and c.isprintable())


def comments(lines: Iterable[str], mark: str) -> list[str]:
    """Return lines as ASCII comments that begin with a mark, those wrapped that are too long for old readers."""
    return [mark + part for line in lines for part in textwrap.wrap(ascii_line(line), _COMMENT)]


def listed(names: Sequence[str], most: int = LISTED, show: Callable[[str], str] = str) -> str:
    """Return names as a list of at most `most`, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(show, names[:most])) + more


def command_line(*words: str) -> str:
    """Return a command of ours as the user can type it: by the path that ran this one, where no shell would find it."""
    typed = Path(sys.argv[0])
    on_path = shutil.which(_PROGRAM)
    by_name = typed.stem != _PROGRAM or (on_path is not None and Path(on_path).resolve() == typed.resolve())
    return shlex.join([_PROGRAM if by_name else path_text(typed), *words])


def path_text(path: Path) -> str:
    """Return a path as text; bytes that are not text become escapes."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def _without_breaks(text: object) -> str:
    """Return a text whose lines are joined by a space; spaces inside a line are part of a label and stay."""
    parts = (part.strip(" ") for part in _BREAKS.split(str(text)))
    return " ".join(part for part in parts if part)


def line_of(attrs: Mapping[Any, Any], row: int) -> int:
    """Return the line, counted from 1, of a row, counted from 0, of a table whose `attrs` say where its rows are.

    `first_line` is that of the first row, by default 2; `blank_lines` has, for each line without a row below it, how
    many rows stand above.
    """
    return attrs.get("first_line", 2) + row + bisect_right(attrs.get("blank_lines", ()), row)
