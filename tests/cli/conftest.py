"""Fixtures that several files of `process` share; nothing may be written into their folders."""

from pathlib import Path

import pytest
from helpers.command_line import here
from helpers.process_recordings import write_recordings


@pytest.fixture(scope="session")
def recordings(tmp_path_factory) -> Path:
    """Return a folder of three simulated recordings, one without a step, one unreadable and one of no case."""
    folder = tmp_path_factory.mktemp("recordings")
    write_recordings(folder)
    return folder


@pytest.fixture(scope="session")
def processed(recordings, tmp_path_factory) -> tuple[Path, str, str]:
    """Return where `process` wrote, and what it printed to stdout and stderr."""
    out = tmp_path_factory.mktemp("processed")
    options = ["--out", out / "records.csv", "--figures", out / "pictures", "--workers", 1]
    done = here("process", recordings, "--method", "inertia", *options)
    assert done.exit_code == 0, done.stderr
    return out, done.stdout, done.stderr
