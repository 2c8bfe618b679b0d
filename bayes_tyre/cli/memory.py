"""Commands with little memory: one line that says how much is needed, whichever library runs out of it first."""

import os
import signal
import sys
from collections.abc import Callable

import typer

from bayes_tyre.cli.messages import fault
from bayes_tyre.errors import NO_MEMORY, says_no_memory
from bayes_tyre.plain_text import reason

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
    return f"{NO_MEMORY}: {_needs(command)}, more with more data; give it more, or less data"


def perhaps_too_little(command: str, end: str) -> str:
    """Return what to say where a command has ended so, and where it may be for want of memory and may not."""
    again = "give it more; if it then ends so too, please report"
    return f"ended by {end}, perhaps for want of memory: {_needs(command)}, more with more data; {again}"


def with_needs(error: Exception, command: str) -> str:
    """Return what bad input says, and how much memory the command needs, where that is limited and was not enough."""
    lacks = NO_MEMORY in str(error) and address_space() is not None
    return f"{error}; {_needs(command)}" if lacks else str(error)


def _needs(command: str) -> str:
    limit = address_space()
    given = "" if limit is None else f" ({limit / 1e6:,.0f} MB are allowed: ulimit -v)"
    return f"{command.replace('_', '-')} needs about {needed_mb(command):,} MB of address space{given}"


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
    Some end without a word, or with an error that does not name memory: with less than the command needs one line says
    that too. An error of another kind is the command's own, as without a limit.
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
        # Python holds the old one for a file where it was one, and would ask the pipe for a position in it.
        sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
        run()
        return
    os.close(writing)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child has it too, and says what to do
    with os.fdopen(reading, "rb") as stream:
        output = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    text, limit = output.decode(errors="backslashreplace"), address_space()
    if code not in _ENDED and says_no_memory(text):
        fault(too_little(command))
    elif code < 0 or (code not in _ENDED and limit is not None and limit < needed_mb(command) * 1e6):
        end = signal.Signals(-code).name if code < 0 else f"code {code}"
        last = [line for line in text.splitlines() if not line[:1].isspace()][-1:]  # not of a list of calls
        fault(perhaps_too_little(command, ": ".join([end, *map(reason, last)])))
    else:
        sys.stderr.write(text)
        raise typer.Exit(code)
    raise typer.Exit(3)
