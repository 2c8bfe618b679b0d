"""The same work on many files, on a dask cluster: dask does the tasks of lost workers again, and nothing here does."""

import asyncio
import logging
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TYPE_CHECKING, Any, cast

from bayes_tyre.errors import BadInput
from bayes_tyre.workflow.execution.outcome import Fault
from bayes_tyre.workflow.execution.parallel import AHEAD

if TYPE_CHECKING:
    from distributed import Client, Future

#: Without the same ones tasks and results do not get across; with others of `_NUMBERS` the last digits may differ.
_NEEDED = ("python", "distributed", "bayes-tyre")
_NUMBERS = ("numpy", "scipy", "pandas", "jax")
#: s; to reach a scheduler, and to say goodbye to one.
_PATIENCE, _FAREWELL = 10, 2


class WorkerLacks(Exception):
    """A worker cannot do the tasks of this process; the message says what it lacks."""


@contextmanager
def connected(address: str) -> "Iterator[Client]":
    """Give a client of the scheduler at an address, such as ``tcp://host:8786``; what dask logs goes nowhere.

    Raises
    ------
    BadInput
        If dask is not installed, the scheduler cannot be reached, or its workers have other versions.
    """
    logged = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # it tells of every worker that comes and goes, in many lines
    try:
        client = _client(address)
        try:
            with _lost_means(client, address):
                versions = cast("Mapping[str, Any]", client.get_versions(packages=["bayes-tyre", "scipy", "jax"]))
            check_versions(versions, address)
            yield client
        finally:
            with suppress(Exception):  # to a scheduler that is lost there is no goodbye
                client.close(timeout=_FAREWELL)
    finally:
        logging.disable(logged)


def _client(address: str) -> "Client":
    try:
        from distributed import Client, Security
        from distributed.comm.core import connect
    except ImportError:
        raise BadInput('--cluster: needs dask; install it with pip install "bayes_tyre[cluster]"') from None

    async def knock() -> None:
        arguments = Security().get_connection_args("client")
        (await connect(address, timeout=_PATIENCE, **arguments)).abort()

    if not address.strip():  # dask would start a cluster of its own
        raise BadInput("--cluster: the address is empty; give that of a scheduler, such as tcp://host:8786")
    try:
        asyncio.run(knock())  # a client that finds nobody leaves a traceback on stderr when it is collected
        with warnings.catch_warnings():  # of versions, in a table: see `check_versions`
            warnings.simplefilter("ignore")
            return Client(address, timeout=_PATIENCE, set_as_default=False)
    except Exception as error:  # addresses are read in many places, each with its own kind of error
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise BadInput(
            f"--cluster {address}: no scheduler can be reached ({reason}); give an address such as tcp://host:8786"
        ) from None


def check_versions(versions: Mapping[str, Any], address: str) -> None:
    """Refuse workers that have other versions than this process of what both must share; warn of other numerics."""
    here = versions["client"]["packages"]
    if not versions["workers"]:
        warnings.warn(f"--cluster {address}: has no workers yet; waiting for one", stacklevel=2)
    packages = {worker: held["packages"] for worker, held in versions["workers"].items()}
    for name in (*_NEEDED, *_NUMBERS):
        for worker, held in packages.items():
            ours, theirs = (_shown(name, version) for version in (here.get(name), held.get(name)))
            if ours == theirs:
                continue
            if name in _NEEDED:
                raise BadInput(
                    f"--cluster {address}: worker {worker} has {name} {theirs}, here is {ours}; install the same there"
                )
            text = f"--cluster {address}: worker {worker} has {name} {theirs}, here is {ours}: last digits may differ"
            warnings.warn(text, stacklevel=2)
            break


def _shown(name: str, version: str | None) -> str:
    return ".".join((version or "none").split(".")[:2]) if name == "python" else version or "none"


def on_cluster[T, R](
    client: "Client", work: Callable[[T], R], tasks: Sequence[T], address: str
) -> Generator[tuple[int, R | Fault]]:
    """Yield each task's index and outcome as it is done; see `in_parallel`.

    Notes
    -----
    Dask gives a task up (`KilledWorker`) when several workers in turn died with it, which may have been another's
    doing. Such tasks are submitted once more, one at a time: what is given up then has the reason as its outcome.

    Raises
    ------
    BadInput
        If the scheduler is lost, or a worker lacks what it needs.
    """
    from distributed import KilledWorker

    doubtful: list[int] = []
    for i, outcome in _submitted(client, work, tasks, range(len(tasks)), address):
        if isinstance(outcome, KilledWorker):
            doubtful.append(i)
        else:
            yield i, outcome
    for alone in doubtful:
        for i, outcome in _submitted(client, work, tasks, [alone], address):
            if isinstance(outcome, KilledWorker):
                reason = "every worker that worked on it died, perhaps for want of memory; cut it in pieces"
                yield i, Fault(reason, lasting=False)
            else:
                yield i, outcome


def _submitted(
    client: "Client", work: Callable[[Any], Any], tasks: Sequence[Any], which: Iterable[int], address: str
) -> Generator[tuple[int, Any]]:
    """Yield outcomes, `KilledWorker` among them; so many futures are out as keep every thread of the cluster busy."""
    from distributed import as_completed

    todo, waiting, done = iter(which), dict["Future", int](), as_completed(loop=client.loop)
    try:
        while True:
            with _lost_means(client, address):
                room = AHEAD * max(1, sum(cast("dict[str, int]", client.nthreads()).values())) - len(waiting)
                for i in islice(todo, max(0, room)):
                    future = client.submit(work, tasks[i], pure=False)
                    waiting[future] = i
                    done.add(future)
                if not waiting:
                    return
                future = next(done)
            outcome = _outcome(client, future, address)
            yield waiting.pop(future), outcome
            del outcome, future
    finally:
        with suppress(Exception):  # a scheduler that is lost has none of them
            client.cancel(list(waiting))


def _outcome(client: "Client", future: "Future", address: str) -> Any:
    from distributed import KilledWorker

    with _lost_means(client, address):
        error = cast("Exception | None", future.exception())
        if error is None:
            return future.result()
    if isinstance(error, KilledWorker):
        return error
    if isinstance(error, WorkerLacks | ImportError):
        raise BadInput(f"--cluster {address}: a worker fails: {error}; install there what is installed here")
    raise error


@contextmanager
def _lost_means(client: "Client", address: str) -> Iterator[None]:
    """Turn what dask raises when the scheduler is gone into how to go on."""
    from distributed import CancelledError

    try:
        yield
    except Exception as error:
        # A client that has given its scheduler up fails in many ways, some of them in its own code.
        if client.status == "running" and not isinstance(error, CancelledError | OSError | RuntimeError):
            raise
        raise BadInput(
            f"--cluster {address}: the scheduler is lost ({type(error).__name__}); what is done is kept: start it "
            "again and go on with --resume"
        ) from None
