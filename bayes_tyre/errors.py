"""The exception for faults in the user's input, which the command line turns into exit code 3; errors of no memory."""

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager

#: Begins what is said of a file for which there was not the memory.
NO_MEMORY = "not enough memory"
#: What is said, each in its own words, where the system gives no memory, no room for a library's code or no thread: by
#: Python, NumPy, pandas, the dynamic linker, the C and C++ libraries, OpenBLAS, HDF5, LLVM and XLA.
_OUT_OF_RESOURCES = re.compile(
    r"MemoryError|not enough memory|out of memory|cannot allocate memory|unable to allocate|failed to allocate"
    r"|memory allocation (still )?failed|failed to map segment|bad_alloc|RESOURCE_EXHAUSTED|can't start new thread"
    r"|pthread_create(\(\))? failed|std::system_error\S*\s+what\(\): +Resource temporarily unavailable",
    re.IGNORECASE,
)


class BadInput(Exception):
    """Input that cannot be used; the message is one line: what is wrong, where, and what to do."""


class CutShort(BadInput):
    """The work cannot go on, what is done is kept, and the same command with --resume continues."""


@contextmanager
def errors_name(what: object) -> Iterator[None]:
    """Put what is at fault, such as a file's path, before the message of `BadInput`."""
    try:
        yield
    except BadInput as error:
        raise BadInput(f"{what}: {error}") from None


def says_no_memory(text: str) -> bool:
    """Return whether a library's last words are that it got no memory, or no thread."""
    return _OUT_OF_RESOURCES.search(text) is not None


def out_of_memory(error: BaseException) -> bool:
    """Return whether an exception was raised for want of memory, by whichever library."""
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return True
    return isinstance(error, Exception) and not isinstance(error, OSError) and says_no_memory(str(error))
