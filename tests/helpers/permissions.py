"""Tests in which a permission is refused: skipped where this process may read and write whatever it likes."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest


def _bind() -> bool:
    with tempfile.NamedTemporaryFile() as file:
        Path(file.name).chmod(0)
        return not os.access(file.name, os.R_OK)


def permissions[**P](test: Callable[P, None]) -> Callable[P, None]:
    """Mark a test; `.ci/run` runs it without root's capabilities to pass over permissions."""
    skipped = pytest.mark.skipif(not _bind(), reason="root may read and write anywhere: permissions do not bind")
    return pytest.mark.permissions(skipped(test))
