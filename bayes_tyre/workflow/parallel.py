"""The same work on many files, side by side: results in the order of the tasks, and a lost process loses nothing."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

# So many tasks a process wait in the pool: enough to keep it busy, few enough that few are in doubt when it breaks.
_AHEAD = 2


def in_parallel[T, R](
    work: Callable[[T], R], tasks: Sequence[T], workers: int | None, on_progress: Callable[[int], None]
) -> list[R | str]:
    """Return the outcome of each task, in the order of the tasks.

    Parameters
    ----------
    work:
        A function of a module, called with each task; what it raises ends all.
    tasks:
        Picklable.
    workers:
        Processes; None: one a core. With one, or one task, no process is started.
    on_progress:
        Called with 1 after each task.

    Notes
    -----
    Where a process dies (killed, out of memory), the tasks that were with the pool are done again, each in a process of
    its own; a task that kills that too has the reason as its outcome. The others go on.
    """
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    outcomes: dict[int, R | str] = {}
    if workers <= 1:
        for i, task in enumerate(tasks):
            outcomes[i] = work(task)
            on_progress(1)
        return [outcomes[i] for i in range(len(tasks))]
    todo = list(range(len(tasks)))
    while todo:
        doubtful = _run(work, tasks, todo, workers, outcomes, on_progress)
        for i in doubtful:
            if _run(work, tasks, [i], 1, outcomes, on_progress):
                outcomes[i] = "the process that worked on it died twice, perhaps for want of memory; cut it in pieces"
                on_progress(1)
        todo = [i for i in todo if i not in outcomes]
    return [outcomes[i] for i in range(len(tasks))]


def _run[T, R](
    work: Callable[[T], R],
    tasks: Sequence[T],
    which: Sequence[int],
    workers: int,
    outcomes: dict[int, R | str],
    on_progress: Callable[[int], None],
) -> list[int]:
    """Fill in outcomes until all are there or a process has died; return the tasks that may have been its last."""
    todo, waiting = iter(which), dict[Future[R], int]()
    context = multiprocessing.get_context("spawn")  # JAX and its threads do not survive a fork
    with ProcessPoolExecutor(workers, context, _begin) as pool:
        try:
            while True:
                while len(waiting) < _AHEAD * workers and (i := next(todo, None)) is not None:
                    waiting[pool.submit(work, tasks[i])] = i
                if not waiting:
                    return []
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                # Those that came back whole first: a broken pool breaks the others of the same moment.
                for future in sorted(done, key=lambda future: future.exception() is not None):
                    outcomes[waiting[future]] = future.result()
                    del waiting[future]
                    on_progress(1)
        except BrokenProcessPool:
            return sorted(waiting.values())


def _begin() -> None:
    """Make a process end silently at Ctrl-C, and when the one that began it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
