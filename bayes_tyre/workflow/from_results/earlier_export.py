"""Files that an earlier export left in a folder: each says at its top that an export wrote it, and its own name."""

import re
from collections.abc import Collection
from importlib.metadata import version
from pathlib import Path

_FITTED = "fitted, not a measurement"
_SUFFIXES = (".tir", ".tdx", ".mo", ".txt", ".csv")
#: How much of a file is read to see what wrote it, characters: its comments are at the top.
_TOP = 4000


def export_marks(name: str) -> list[str]:
    """Return the comments by which a file of an export is known again, of a name without suffix."""
    return [f"bayes-tyre {version('bayes-tyre')}: {_FITTED}", f"file: {name}"]


def remove_earlier(out: Path, written: Collection[Path]) -> None:
    """Remove the files of earlier exports from a folder but those written now.

    What was copied or renamed has another name than it says, and stays.
    """
    for path in out.iterdir():
        if path not in written and path.suffix in _SUFFIXES and path.is_file() and _is_export(path):
            path.unlink(missing_ok=True)


def _is_export(path: Path) -> bool:
    try:
        with path.open(encoding="ascii", errors="replace") as file:
            top = file.read(_TOP)
    except OSError:  # what cannot be read is somebody else's
        return False
    return _FITTED in top and re.search(rf"^\W*file: {re.escape(path.stem)}$", top, re.MULTILINE) is not None
