"""Commands with little memory: one line that says how much is needed, whichever library runs out of it first."""

import os
import signal
import sys
from collections.abc import Callable

import typer

from bayes_tyre.cli.messages import fault

#: MB of address space that is enough on two cores (`tests/cli/test_memory.py`): of commands that sample or fit many
#: data sets, and of all others. Libraries reserve most of it and never use it.
_SAMPLES = ("fit", "motion", "published", "compare", "audit", "study")
NEEDED_BY_SAMPLING, NEEDED = 6000, 4000
_ENDED = (0, 2, 3, 4, 130)


def needed_mb(command: str) -> int:
    """Return how much address space (MB) a command needs on data of usual size."""
    return NEEDED_BY_SAMPLING if command.split()[0] in _SAMPLES else NEEDED


def too_little(command: str) -> str:
    """Return what to say where a command has run out of memory."""
    limit = address_space()
    given = "" if limit is None else f" ({limit / 1e6:,.0f} MB are allowed: ulimit -v)"
    needs = f"{command.replace('_', '-')} needs about {needed_mb(command):,} MB of address space"
    return f"not enough memory: {needs}{given}, more with more data; give it more, or less data"


def address_space() -> int | None:
    """Return the bytes of address space that this process may have; None where there is no limit."""
    try:
        import resource
    except ImportError:  # not on Windows
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def within_limit(run: Callable[[], None], command: str) -> None:
    """Run; where the address space is limited, in a process of its own, whose end for want of memory is one line.

    JAX, HDF5 and OpenBLAS end their process, each in its own words, where they get no memory: no exception is raised.
    """
    if address_space() is None:
        run()
        return
    sys.stdout.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.dup2(writing, 2)
        os.close(reading)
        os.close(writing)
        run()
        return
    os.close(writing)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child has it too, and says what to do
    with os.fdopen(reading, "rb") as stream:
        said = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code in _ENDED:
        sys.stderr.write(said.decode(errors="backslashreplace"))
        raise typer.Exit(code)
    fault(too_little(command))
    raise typer.Exit(3)
