"""The same work on each of many raw files, on an executor here or on a cluster; each result is cached once it is there.

One loop over `concurrent.futures` serves both. `Executor.map` would not do: it submits every task at once, so that
memory grows with the number of files, and it ends with the first worker that dies.
"""

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import ExitStack, closing
from functools import partial
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.workflow.execution.cluster import WorkerMismatch, cluster_executors, connected
from bayes_tyre.workflow.execution.executors import Executors, local_processes
from bayes_tyre.workflow.execution.outcome import Done, Fault, FileTask, fingerprint
from bayes_tyre.workflow.execution.task_cache import TaskCache

type Keyed = tuple[str | None, Done | Fault]

_DIED = "every process that worked on it died, perhaps for want of memory; cut the file in pieces"
_STUDY_DIED = "two processes died at a data set, perhaps for want of memory; --resume --workers 1 needs less"
#: s between looks at the executor: futures of a lost scheduler may never be done.
_LOOK = 1.0


class Machines(NamedTuple):
    """Number of processes here (None: one a core), or address of a cluster's scheduler; whether to resume a run."""

    workers: int | None = None
    cluster: str | None = None
    resume: bool = False


def run_batch[T: FileTask](
    work: Callable[[T], Done | Fault],
    tasks: Sequence[T],
    cache: TaskCache,
    machines: Machines,
    on_progress: Callable[[int], None],
) -> list[Path | Fault]:
    """Return where each task's result is cached, or why there is none, in the order of the tasks.

    Parameters
    ----------
    work:
        A function of a module; an exception from it ends the batch, results so far stay cached.
    tasks:
        One a file.
    cache:
        Where results are written; with `machines.resume`, results in it are not computed again.
    machines:
        Processes, cluster, resume.
    on_progress:
        Called with 1 after each file.

    Raises
    ------
    BadInput
        If the cluster cannot be reached, before anything is written; if it, or all its workers, are lost.
    """
    outcomes: dict[int, Path | Fault] = {}
    keys: set[str] = set()
    for i, task in enumerate(tasks) if machines.resume else ():
        key = fingerprint(task)
        cached = cache.find(key, task.figure) if key is not None else None
        if key is not None and cached is not None:
            outcomes[i] = cached
            keys.add(key)
            on_progress(1)
    todo = [i for i in range(len(tasks)) if i not in outcomes]
    with ExitStack() as stack:
        keyed = partial(_keyed, work, version("bayes-tyre"))
        completed = _started(keyed, [tasks[i] for i in todo], machines, stack)
        cache.prepare(machines.resume, [task.figure for task in tasks if task.figure is not None])
        for nth, outcome in completed:
            i = todo[nth]
            if isinstance(outcome, Fault):  # its workers died: there is no result to cache
                outcomes[i] = outcome
            else:
                key, result = outcome[0], _checked_disk(outcome[1], outcome[0], tasks[i], machines)
                outcomes[i] = _cached(cache, key, result, tasks[i].figure)
                keys |= {key} if key is not None else set()
                del result
            del outcome  # or it is in memory beside the next ones
            on_progress(1)
    cache.keep_only(keys)
    return [outcomes[i] for i in range(len(tasks))]


def cached_tables[T](
    work: Callable[[T], pd.DataFrame],
    tasks: Mapping[str, T],
    cache: TaskCache,
    on_progress: Callable[[int], None],
    workers: int | None = 1,
) -> list[Path]:
    """Return where the table of each task is cached, in the order of the tasks; those cached are not computed again.

    Parameters
    ----------
    work:
        Returns a task's table; a picklable function where there are several workers.
    tasks:
        By the fingerprint of all that determines their table.
    cache:
        Where tables are, prepared.
    on_progress:
        Called with 1 after each task.
    workers:
        Processes; None: one a core.

    Raises
    ------
    BadInput
        If each process that worked on one of them died; tables so far stay cached.
    """
    parts: dict[str, Path] = {}
    for key in tasks:
        if isinstance(part := cache.find(key, None), Path):
            parts[key] = part
            on_progress(1)
    keys = [key for key in tasks if key not in parts]
    with closing(_computed(work, [tasks[key] for key in keys], workers)) as computed:
        for nth, table in computed:
            if isinstance(table, Fault):
                raise BadInput(f"{cache.folder}: {_STUDY_DIED}")
            part = cache.keep(keys[nth], Done(table), None)
            assert isinstance(part, Path)
            parts[keys[nth]] = part
            on_progress(1)
    return [parts[key] for key in tasks]


def _computed[T, R](
    work: Callable[[T], R], tasks: Sequence[T], workers: int | None
) -> Generator[tuple[int, R | Fault]]:
    count = min(workers or os.cpu_count() or 1, len(tasks))
    if count <= 1:
        yield from ((i, work(task)) for i, task in enumerate(tasks))
    else:
        yield from as_completed(local_processes(count), work, tasks)


def as_completed[T, R](
    executors: Executors, work: Callable[[T], R], tasks: Sequence[T]
) -> Generator[tuple[int, R | Fault]]:
    """Yield each task's index and outcome as it is done; no more outcomes than `capacity` are in memory.

    Where a worker dies (killed, out of memory), its executor is emptied and each task in doubt is repeated on an
    executor of its own; a task whose worker dies again has a `Fault`. The other tasks then continue on a new executor.

    Parameters
    ----------
    executors:
        Where tasks run.
    work:
        A function of a module, called with each task; an exception from it is raised here.
    tasks:
        Picklable.
    """
    todo = iter(range(len(tasks)))
    while doubtful := (yield from _until_death(executors, work, tasks, todo)):
        for i in doubtful:
            if (yield from _until_death(executors, work, tasks, iter([i]))):
                yield i, Fault(_DIED, lasting=False)


def _until_death[T, R](
    executors: Executors, work: Callable[[T], R], tasks: Sequence[T], todo: Iterator[int]
) -> Generator[tuple[int, R], None, list[int]]:
    """Yield outcomes until all are done or a worker has died; return the tasks that may have been its last."""
    waiting: dict[Future[R], int] = {}
    doubtful: list[int] = []
    with executors.start() as executor:
        while True:
            with executors.explained():
                room = executors.capacity() - len(waiting)
                for i in islice(todo, 0 if doubtful else max(0, room)):
                    try:
                        waiting[executor.submit(work, tasks[i])] = i
                    except executors.worker_died:
                        doubtful.append(i)
                        break
                if not waiting:
                    return sorted(doubtful)
                done = _errors_last(wait(waiting, _LOOK, FIRST_COMPLETED).done)
            for future in done:
                i, error = waiting.pop(future), future.exception()
                if error is None:
                    yield i, future.result()
                elif isinstance(error, executors.worker_died):
                    doubtful.append(i)
                else:
                    raise error
                del future  # or its result is in memory beside the next ones
            del done


def _errors_last[R](done: Iterable[Future[R]]) -> list[Future[R]]:
    """Return futures, those with a result first: an error must not lose results of the same moment."""
    return sorted(done, key=lambda future: future.exception() is not None)


def _started[T: FileTask](
    work: Callable[[T], Keyed], tasks: Sequence[T], machines: Machines, stack: ExitStack
) -> Iterator[tuple[int, Keyed | Fault]]:
    """Return the outcomes to come; a cluster is connected to now, and left at the end of the stack."""
    if machines.cluster is not None and tasks:
        executors = cluster_executors(stack.enter_context(connected(machines.cluster)), machines.cluster)
    else:
        return stack.enter_context(closing(_computed(work, tasks, machines.workers)))
    return stack.enter_context(closing(as_completed(executors, work, tasks)))


def _keyed[T: FileTask](work: Callable[[T], Done | Fault], required: str, task: T) -> Keyed:
    """Return a task's fingerprint, taken before `work` reads its file, and its outcome."""
    if version("bayes-tyre") != required:  # a worker that joined after the versions were checked
        raise WorkerMismatch(f"it has bayes-tyre {version('bayes-tyre')}, here is {required}")
    return fingerprint(task), work(task)


def _checked_disk(result: Done | Fault, key: str | None, task: FileTask, machines: Machines) -> Done | Fault:
    """Return the result; a fault that says so where a file can be read here but not on the cluster's workers."""
    if key is None and machines.cluster is not None and isinstance(result, Fault) and os.access(task.file, os.R_OK):
        return Fault(f"the workers at {machines.cluster} cannot read it; put it on a disk that they share", False)
    return result


def _cached(cache: TaskCache, key: str | None, result: Done | Fault, figure: Path | None) -> Path | Fault:
    if key is None:
        return result if isinstance(result, Fault) else Fault("cannot be read each time; check the disk", lasting=False)
    if isinstance(result, Fault) and not result.lasting:
        return result
    return cache.keep(key, result, figure)
