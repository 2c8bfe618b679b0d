"""How what commands promise is tried for long: so many examples from a seed, as long as they take."""

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, Phase, settings


def examples(count: int) -> settings:
    """Return settings for so many examples, of which a failing one is shrunk; nothing is kept between runs."""
    return settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
    )


def fuzz_for_long(fuzz: Callable[[int, Path, int], Counter[int]], what: str) -> None:
    """Try so many of what is named, from a seed, as the command line says; print how often each exit code came out."""
    count, start = (*map(int, sys.argv[1:]), *(1000, 0)[len(sys.argv) - 1 :])
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        counts = fuzz(count, Path(folder), start)
    seconds = time.monotonic() - began
    print(f"{counts.total()} {what} in {seconds:.0f} s, by exit code: {dict(sorted(counts.items()))}")
