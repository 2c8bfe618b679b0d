"""What the reference page of files names."""

import re
from pathlib import Path

_PAGE = Path(__file__).parents[2] / "docs/reference/files.md"


def documented_columns() -> set[str]:
    """Return all names in code type on the page, columns among them."""
    return set(re.findall(r"`(\w+)`", _PAGE.read_text(encoding="utf-8")))
