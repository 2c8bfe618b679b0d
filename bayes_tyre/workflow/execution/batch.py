"""The same work on each of many raw files, on the cores here or on a cluster; each result is kept once it is there."""

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.workflow.execution.cluster import WorkerLacks, connected, on_cluster
from bayes_tyre.workflow.execution.outcome import Done, Fault, FileTask, fingerprint
from bayes_tyre.workflow.execution.parallel import in_parallel
from bayes_tyre.workflow.execution.task_cache import Parts

type Keyed = tuple[str | None, Done | Fault]


class Machines(NamedTuple):
    """Processes here (None: one a core), or the address of a cluster's scheduler; whether to go on with a run."""

    workers: int | None = None
    cluster: str | None = None
    resume: bool = False


def each_file[T: FileTask](
    work: Callable[[T], Done | Fault],
    tasks: Sequence[T],
    parts: Parts,
    machines: Machines,
    on_progress: Callable[[int], None],
) -> list[Path | Fault]:
    """Return where each task's result is kept, or why there is none, in the order of the tasks.

    Parameters
    ----------
    work:
        A function of a module; what it raises ends all, and what is done stays kept.
    tasks:
        One a file.
    parts:
        Where results are kept; with `machines.resume`, those that are there already are not made again.
    machines:
        Processes, cluster, resume.
    on_progress:
        Called with 1 after each file.

    Raises
    ------
    BadInput
        If the cluster cannot be reached, before anything is written; if it is lost.
    """
    outcomes: dict[int, Path | Fault] = {}
    keys: set[str] = set()
    for i, task in enumerate(tasks) if machines.resume else ():
        key = fingerprint(task)
        found = parts.find(key, task.picture) if key is not None else None
        if key is not None and found is not None:
            outcomes[i] = found
            keys.add(key)
            on_progress(1)
    todo = [i for i in range(len(tasks)) if i not in outcomes]
    with ExitStack() as stack:
        done = _begun(partial(_keyed, work, version("bayes-tyre")), [tasks[i] for i in todo], machines, stack)
        parts.begin(machines.resume, [task.picture for task in tasks if task.picture is not None])
        for nth, outcome in done:
            i = todo[nth]
            if isinstance(outcome, Fault):  # who worked on it died: there is no more to say, and nothing to keep
                outcomes[i] = outcome
            else:
                key, result = outcome[0], _blamed(outcome[1], outcome[0], tasks[i], machines)
                outcomes[i] = _kept(parts, key, result, tasks[i].picture)
                keys |= {key} if key is not None else set()
                del result
            del outcome
            on_progress(1)
    parts.keep_only(keys)
    return [outcomes[i] for i in range(len(tasks))]


def _begun[T: FileTask](
    work: Callable[[T], Keyed], tasks: Sequence[T], machines: Machines, stack: ExitStack
) -> Generator[tuple[int, Keyed | Fault]]:
    """Return the outcomes to come; a cluster is connected to now, and left at the end of the stack."""
    if machines.cluster is None or not tasks:
        done = in_parallel(work, tasks, machines.workers)
    else:
        client = stack.enter_context(connected(machines.cluster))
        done = on_cluster(client, work, tasks, machines.cluster)
    return stack.enter_context(closing(done))


def _keyed[T: FileTask](work: Callable[[T], Done | Fault], asked_by: str, task: T) -> Keyed:
    """Return a task's fingerprint, taken before its file is read for the work, and its outcome."""
    if version("bayes-tyre") != asked_by:  # a worker that joined late
        raise WorkerLacks(f"it has bayes-tyre {version('bayes-tyre')}, here is {asked_by}")
    return fingerprint(task), work(task)


def _blamed(result: Done | Fault, key: str | None, task: FileTask, machines: Machines) -> Done | Fault:
    """Return a fault that says so where a file is here but not where the workers are."""
    if key is None and machines.cluster is not None and isinstance(result, Fault) and os.access(task.file, os.R_OK):
        return Fault(f"the workers at {machines.cluster} cannot read it; put it on a disk that they share", False)
    return result


def _kept(parts: Parts, key: str | None, result: Done | Fault, picture: Path | None) -> Path | Fault:
    if key is None:
        return result if isinstance(result, Fault) else Fault("cannot be read each time; check the disk", lasting=False)
    if isinstance(result, Fault) and not result.lasting:
        return result
    return parts.keep(key, result, picture)
