"""TOML and JSON files of bounded size and depth, read with one kind of error."""

import json
import tomllib
from itertools import chain
from pathlib import Path
from typing import Any

#: Bytes of a TOML file, which a person writes; dots of one line, each of which nests one level deeper, and takes the
#: square of their number to parse.
MOST_TOML, MOST_DOTS = 1 << 19, 500
#: Levels of tables and lists in one another: what reads the content calls itself once a level.
MOST_LEVELS = 50


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file, UTF-8 with or without its mark.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, is no TOML, or is longer or deeper than a person writes.
    """
    with path.open("rb") as file:
        content = file.read(MOST_TOML + 1)
    if len(content) > MOST_TOML:
        raise ValueError(f"it is longer than {MOST_TOML} bytes")
    text = content.decode("utf-8-sig")
    if any(line.count(".") > MOST_DOTS for line in text.splitlines()):
        raise ValueError(f"a line has more than {MOST_DOTS} dots")
    try:
        return _shallow(tomllib.loads(text))
    except RecursionError:
        raise ValueError(f"it is nested more than {MOST_LEVELS} deep") from None


def read_json(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, is no JSON, or is nested too deep.
    """
    try:
        return _shallow(json.loads(path.read_text(encoding="utf-8")))
    except RecursionError:
        raise ValueError(f"it is nested more than {MOST_LEVELS} deep") from None


def _shallow[T](content: T) -> T:
    """Return the content, or raise where it is nested too deep."""
    level: list[Any] = [content]
    for _ in range(MOST_LEVELS):
        level = [each.values() if isinstance(each, dict) else each for each in level if isinstance(each, dict | list)]
        level = [*chain.from_iterable(level)]
        if not level:
            return content
    raise ValueError(f"it is nested more than {MOST_LEVELS} deep")
