"""Fits and least-squares tables one after the other in one process: what they keep of memory must not grow.

As a program (`make soak`) it makes 50 fits and 500 tables: ``python -m helpers.soak 50 500``.
"""

import gc
import sys
import time
import warnings
from collections.abc import Callable

import psutil
from helpers.command_line import SMALL
from helpers.simulated_records import Plan, simulate

import bayes_tyre as bt

#: From here on memory is flat: no more than so many times what it was after the fifth fit. Of each fit JAX keeps about
#: 1 MB of what it traced.
SETTLED, ALLOWED = 5, 1.10


def resident_mb() -> float:
    """Return the memory that this process holds (MB), what Python could give back at once not counted."""
    gc.collect()
    return psutil.Process().memory_info().rss / 1e6


def soak(fits: int, tables: int, plan: Plan = SMALL, say: Callable[[str], None] = print) -> list[float]:
    """Fit records of one plan so often, each fit followed by its share of the tables; return memory (MB) after each.

    Parameters
    ----------
    fits, tables:
        How many hierarchical fits, and how many tables of least squares.
    plan:
        What to simulate, for every fit and table anew: their seeds are their numbers.
    say:
        Called with the memory after every fit and its tables.
    """
    settings, after = bt.SamplerSettings(2, 130, 170, target_accept=0.65), list[float]()
    for number in range(fits):
        with warnings.catch_warnings(category=UserWarning, action="ignore"):  # so few draws are not to be trusted
            bt.fit(simulate(plan, number)[0], settings, progress=False)
        for table in range(number * tables // fits, (number + 1) * tables // fits):
            bt.fit_least_squares(simulate(plan, table)[0])
        after.append(resident_mb())
        say(f"after fit {number + 1}: {after[-1]:.0f} MB")
    return after


def assert_flat(after: list[float], fits: int = SETTLED) -> float:
    """Assert that memory was flat after so many fits; return the most of it as a share of what it was then."""
    settled, most = after[fits - 1], max(after[fits - 1 :])
    assert most <= ALLOWED * settled, f"{most:.0f} MB is more than {ALLOWED:g} x the {settled:.0f} MB after fit {fits}"
    return most / settled


def main() -> None:
    """Soak as often as the command line says, print memory as it goes, and what share of the fifth's it reached."""
    fits, tables = (*map(int, sys.argv[1:]), *(50, 500)[len(sys.argv) - 1 :])
    began = time.monotonic()
    after = soak(fits, tables, say=lambda text: print(text, flush=True))
    share = assert_flat(after)
    seconds = time.monotonic() - began
    print(f"{fits} fits and {tables} tables in {seconds:.0f} s: {after[0]:.0f} MB after the first, ", end="")
    print(f"{after[SETTLED - 1]:.0f} MB after the fifth, then at most {share:.2f} times that")


if __name__ == "__main__":
    main()
