"""Executors of `concurrent.futures`: processes on this computer; and what the batch needs beside the interface.

The interface has no word for a dead worker, a lost scheduler or the number of tasks to keep submitted. `Executors`
adds these three; everything else about a batch is one loop over `submit` and `wait` (`batch.py`).
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import NamedTuple

#: Tasks submitted per worker: enough to keep it busy, few enough that few are in doubt when a worker dies.
TASKS_PER_WORKER = 2


class Executors(NamedTuple):
    """Executors of one kind.

    Attributes
    ----------
    start:
        Start an executor; leaving its context cancels what has not run.
    capacity:
        Return how many tasks to keep submitted; called at every look at the futures.
    worker_died:
        What a future, or `submit`, raises after a worker died.
    explained:
        Context of every call to the executor; turns errors of the connection to it into `BadInput`.
    """

    start: Callable[[], AbstractContextManager[Executor]]
    capacity: Callable[[], int]
    worker_died: type[Exception] = BrokenExecutor
    explained: Callable[[], AbstractContextManager[None]] = nullcontext


def local_processes(count: int) -> Executors:
    """Return executors with this many processes on this computer."""

    @contextmanager
    def start() -> Iterator[Executor]:
        context = multiprocessing.get_context("spawn")  # JAX and its threads do not survive a fork
        pool = ProcessPoolExecutor(count, context, _end_with_parent)
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)

    return Executors(start, lambda: TASKS_PER_WORKER * count)


def _end_with_parent() -> None:
    """Make a process end silently at Ctrl-C, and when its parent has ended."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
