"""Out of memory: one line says how much a command needs, whichever library fails first."""

import os
import signal
import sys
from collections.abc import Callable

import typer

from bayes_tyre.cli.messages import fault
from bayes_tyre.errors import NO_MEMORY, says_no_memory
from bayes_tyre.plain_text import reason

#: Commands that sample, or fit many data sets.
_SAMPLING_COMMANDS = ("fit", "motion", "published", "compare", "audit", "study")
#: MB of address space that is enough on two cores (`tests/cli/test_memory.py`): for these commands, and for all others.
#: Libraries reserve most of it and never use it.
NEEDED_BY_SAMPLING, NEEDED = 6000, 4000
#: Exit codes that a command sets itself; any other means that an uncaught error, a library or the system ended it.
_OWN_EXIT_CODES = (0, 2, 3, 4, 130)


def needed_mb(command: str) -> int:
    """Return how much address space (MB) a command needs on data of usual size."""
    return NEEDED_BY_SAMPLING if command.split()[0] in _SAMPLING_COMMANDS else NEEDED


def too_little(command: str) -> str:
    """Return the message for a command that has run out of memory."""
    return f"{NO_MEMORY}: {_needs(command)}, more with more data; give it more, or less data"


def perhaps_too_little(command: str, end: str) -> str:
    """Return the message for a command ended by the signal or exit code `end`, perhaps because memory ran out."""
    advice = "give it more; if it then ends so too, please report"
    return f"ended by {end}, perhaps for want of memory: {_needs(command)}, more with more data; {advice}"


def with_needs(error: Exception, command: str) -> str:
    """Return the message of an error; if limited memory caused it, add how much the command needs."""
    lacks_memory = NO_MEMORY in str(error) and address_space() is not None
    return f"{error}; {_needs(command)}" if lacks_memory else str(error)


def _needs(command: str) -> str:
    limit = address_space()
    allowed = "" if limit is None else f" ({limit / 1e6:,.0f} MB are allowed: ulimit -v)"
    return f"{command.replace('_', '-')} needs about {needed_mb(command):,} MB of address space{allowed}"


def address_space() -> int | None:
    """Return the bytes of address space that this process may have; None where there is no limit."""
    try:
        import resource
    except ImportError:  # not on Windows
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def within_limit(run: Callable[[], None], command: str) -> None:
    """Run a command; if address space is limited, run it in a child process, and report a lack of memory in one line.

    JAX, HDF5 and OpenBLAS raise no exception when they get no memory: they end the process, each with its own message.
    Some print no message, or one that does not name memory. If the limit is below what the command needs, one line
    says so in that case too. Every other error is printed as without a limit.
    """
    if address_space() is None:
        run()
        return
    sys.stdout.flush()
    read_end, write_end = os.pipe()
    child = os.fork()
    if not child:
        os.dup2(write_end, 2)
        os.close(read_end)
        os.close(write_end)
        # If stderr was a file, the old object still treats it as one, and would ask the pipe for a file position.
        sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
        run()
        return
    os.close(write_end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child receives Ctrl-C too, and prints how to continue
    with os.fdopen(read_end, "rb") as stream:
        output = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    text, limit = output.decode(errors="backslashreplace"), address_space()
    if code not in _OWN_EXIT_CODES and says_no_memory(text):
        fault(too_little(command))
    elif code < 0 or (code not in _OWN_EXIT_CODES and limit is not None and limit < needed_mb(command) * 1e6):
        end = signal.Signals(-code).name if code < 0 else f"code {code}"
        last_line = [line for line in text.splitlines() if not line[:1].isspace()][-1:]  # skips indented traceback
        fault(perhaps_too_little(command, ": ".join([end, *map(reason, last_line)])))
    else:
        sys.stderr.write(text)
        raise typer.Exit(code)
    raise typer.Exit(3)
