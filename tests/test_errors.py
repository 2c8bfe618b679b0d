"""Which ends of a command are for want of memory, as the libraries said it under a limited address space."""

import errno

import numpy as np
import pytest

from bayes_tyre.errors import BadInput, out_of_memory, says_no_memory

SAID = [
    "ImportError: libjax_common.so: failed to map segment from shared object",
    "cannot allocate memory for thread-local data: ABORT",
    "OpenBLAS error: Memory allocation still failed after 10 retries, giving up.",
    "terminate called after throwing an instance of 'std::bad_alloc'",
    "terminate called after throwing an instance of 'std::system_error'\n  what():  Resource temporarily unavailable",
    "Check failed: ret == 0 (11 vs. 0) Thread tf_XLACompile creation via pthread_create() failed.",
    "allocateMappedMemory failed with error: Cannot allocate memory\nLLVM ERROR: Unable to allocate section memory!",
    "RESOURCE_EXHAUSTED: Out of memory allocating 92082568 bytes.",
    "RuntimeError: can't start new thread",
    "Error tokenizing data. C error: out of memory",
]


@pytest.mark.parametrize("text", SAID)
def test_what_libraries_say_without_memory_is_known(text):
    assert says_no_memory(text)
    assert out_of_memory(RuntimeError(text))


def test_errors_of_memory_are_known_by_their_kind():
    with pytest.raises(MemoryError) as too_much:
        np.ones(1 << 50)
    assert out_of_memory(too_much.value)
    assert out_of_memory(OSError(errno.ENOMEM, "as the system says it"))


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"),
        ZeroDivisionError("division by zero"),
        BadInput("records.csv: no such file; check the path"),
    ],
)
def test_other_errors_are_not_for_want_of_memory(error):
    assert not out_of_memory(error)
    assert not says_no_memory(repr(error))
