"""The same work on many files, side by side on the cores here: a lost process loses nothing."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from bayes_tyre.workflow.execution.outcome import Fault

# So many tasks a process wait in the pool: enough to keep it busy, few enough that few are in doubt when it breaks.
AHEAD = 2


def in_parallel[T, R](
    work: Callable[[T], R], tasks: Sequence[T], workers: int | None
) -> Generator[tuple[int, R | Fault]]:
    """Yield each task's index and outcome as it is done; no more than a few outcomes are in memory.

    Parameters
    ----------
    work:
        A function of a module, called with each task; what it raises ends all.
    tasks:
        Picklable.
    workers:
        Processes; None: one a core. With one, or one task, no process is started.

    Notes
    -----
    Where a process dies (killed, out of memory), the tasks that were with the pool are done again, each in a process of
    its own; a task that kills that too has the reason as its outcome. The others go on.
    """
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    todo = iter(range(len(tasks)))
    if workers <= 1:
        yield from ((i, work(tasks[i])) for i in todo)
        return
    while doubtful := (yield from _run(work, tasks, todo, workers)):
        for i in doubtful:
            if (yield from _run(work, tasks, iter([i]), 1)):
                reason = "the process that worked on it died twice, perhaps for want of memory; cut it in pieces"
                yield i, Fault(reason, lasting=False)


def _run[T, R](
    work: Callable[[T], R], tasks: Sequence[T], todo: Iterator[int], workers: int
) -> Generator[tuple[int, R], None, list[int]]:
    """Yield outcomes until all are there or a process has died; return the tasks that may have been its last."""
    context = multiprocessing.get_context("spawn")  # JAX and its threads do not survive a fork
    waiting = dict[Future[R], int]()
    out = set[int]()
    with ProcessPoolExecutor(workers, context, _begin) as pool:
        try:
            while True:
                while len(waiting) < AHEAD * workers and (i := next(todo, None)) is not None:
                    out.add(i)
                    waiting[pool.submit(work, tasks[i])] = i
                if not waiting:
                    return []
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                # Those that came back whole first: a broken pool breaks the others of the same moment.
                for future in sorted(done, key=lambda future: future.exception() is not None):
                    result, i = future.result(), waiting.pop(future)
                    out.remove(i)
                    yield i, result
                del done, future, result  # or they are in memory beside those that come next
        except BrokenProcessPool:
            return sorted(out)
        finally:
            for future in waiting:
                future.cancel()


def _begin() -> None:
    """Make a process end silently at Ctrl-C, and when the one that began it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
