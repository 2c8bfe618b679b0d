"""The short form of `make soak`, in a process of its own; and that its check can fail."""

import subprocess
import sys
from pathlib import Path

import pytest
from helpers.soak import assert_flat

#: Without `return_freed_memory` it is 2 GB.
SHORT = "from helpers.soak import assert_flat, soak; after = soak(3, 6); assert_flat(after, 2); assert after[-1] < 1500"


@pytest.mark.slow
def test_memory_is_flat_after_a_few_fits_and_tables():
    done = subprocess.run([sys.executable, "-c", SHORT], cwd=Path(__file__).parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(" MB\n") == 3


def test_memory_that_grows_is_found():
    assert assert_flat([500.0, 800.0, 900.0, 900.0, 1000.0, 1050.0]) == 1.05
    with pytest.raises(AssertionError, match=r"1200 MB is more than 1\.1 x the 1000 MB after fit 5"):
        assert_flat([500.0, 800.0, 900.0, 900.0, 1000.0, 1200.0])
