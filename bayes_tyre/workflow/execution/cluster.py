"""A Dask cluster as an executor of `concurrent.futures`. Dask itself repeats the tasks of lost workers.

Dask does not check that workers have the versions of this process, and says nothing of a lost scheduler: its futures
are cancelled, or never done. Both are checked here.
"""

import asyncio
import logging
import time
import warnings
from collections.abc import Awaitable, Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, cast, override

from bayes_tyre.errors import BadInput, CutShort
from bayes_tyre.plain_text import reason
from bayes_tyre.workflow.execution.executors import TASKS_PER_WORKER, Executors

if TYPE_CHECKING:
    from distributed import Client
    from tornado.ioloop import IOLoop

#: Must be equal here and on the workers, or tasks cannot be exchanged.
_REQUIRED = ("python", "distributed", "bayes-tyre")
#: Where these differ, the last digits of results may differ.
_NUMERICAL = ("numpy", "scipy", "pandas", "jax")
#: s; to connect to a scheduler, and to disconnect from one.
_CONNECT_TIMEOUT, _CLOSE_TIMEOUT = 10, 2
#: s; how long a cluster that has lost all its workers may be without one.
WITHOUT_WORKERS = 60


class WorkerMismatch(Exception):
    """A worker cannot run the tasks of this process; the message says why."""


@contextmanager
def connected(address: str) -> "Iterator[Client]":
    """Connect to the scheduler at an address, such as ``tcp://host:8786``; Dask's log messages are suppressed.

    Raises
    ------
    BadInput
        If Dask is not installed, the scheduler cannot be reached, or its workers have other versions.
    """
    logged = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # Dask logs every worker that joins or leaves, in many lines
    try:
        client = _client(address)
        try:
            with _explained(client, address):
                versions = cast("Mapping[str, Any]", client.get_versions(packages=["bayes-tyre", "scipy", "jax"]))
            check_versions(versions, address)
            yield client
        except (WorkerMismatch, ImportError) as error:
            raise BadInput(
                f"--cluster {address}: a worker fails: {error}; install there what is installed here"
            ) from None
        finally:
            with suppress(Exception):  # the scheduler may be lost
                client.close(timeout=_CLOSE_TIMEOUT)
    finally:
        logging.disable(logged)


def _client(address: str) -> "Client":
    try:
        from distributed import Client, Security
        from distributed.comm.core import connect
    except ImportError:
        raise BadInput('--cluster: needs dask; install it with pip install "bayes_tyre[cluster]"') from None

    async def connect_once() -> None:
        arguments = Security().get_connection_args("client")
        (await connect(address, timeout=_CONNECT_TIMEOUT, **arguments)).abort()

    if not address.strip():  # Dask would start a local cluster
        raise BadInput("--cluster: the address is empty; give that of a scheduler, such as tcp://host:8786")
    try:
        asyncio.run(connect_once())  # a client without a scheduler prints a traceback when it is collected
        with warnings.catch_warnings():  # a table of versions; `check_versions` says it in one line
            warnings.simplefilter("ignore")
            return Client(address, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except Exception as error:  # each transport raises errors of its own
        raise BadInput(
            f"--cluster {address}: no scheduler can be reached ({reason(error)}); give an address such as tcp://host:8786"
        ) from None


def check_versions(versions: Mapping[str, Any], address: str) -> None:
    """Refuse workers whose versions of required packages differ; warn where those of numerical packages differ.

    Raises
    ------
    BadInput
        If a worker has another version of Python, distributed or bayes-tyre than this process.
    """
    here = versions["client"]["packages"]
    if not versions["workers"]:
        warnings.warn(f"--cluster {address}: has no workers yet; waiting for one", stacklevel=2)
    packages = {worker: info["packages"] for worker, info in versions["workers"].items()}
    for name in (*_REQUIRED, *_NUMERICAL):
        for worker, installed in packages.items():
            ours, theirs = (_version_text(name, version) for version in (here.get(name), installed.get(name)))
            if ours == theirs:
                continue
            if name in _REQUIRED:
                raise BadInput(
                    f"--cluster {address}: worker {worker} has {name} {theirs}, here is {ours}; install the same there"
                )
            text = f"--cluster {address}: worker {worker} has {name} {theirs}, here is {ours}: last digits may differ"
            warnings.warn(text, stacklevel=2)
            break


def _version_text(name: str, version: str | None) -> str:
    return ".".join((version or "none").split(".")[:2]) if name == "python" else version or "none"


class _ClusterExecutor(Executor):
    """An executor on a cluster; in `Client.get_executor`'s a future whose result is lost with its worker is never done.

    That happens where a worker dies between the end of a task and the fetching of its result, and the task then fails
    when it is repeated.
    """

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._remote: set[Any] = set()

    @override
    def submit[**P, R](self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Submit a call, as `concurrent.futures.Executor.submit`."""
        remote, local = self._client.submit(fn, *args, pure=False, **kwargs), Future[R]()

        async def pass_on() -> None:
            try:
                (result,) = await cast("Awaitable[list[R]]", self._client.gather([remote], asynchronous=True))
            except (CancelledError, asyncio.CancelledError):
                local.cancel()
                local.set_running_or_notify_cancel()
            except BaseException as error:
                local.set_exception(error)
            else:
                local.set_result(result)
            self._remote.discard(remote)

        self._remote.add(remote)
        cast("IOLoop", self._client.loop).add_callback(pass_on)
        return local

    @override
    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel what is not done: nothing of it is wanted any more."""
        with suppress(Exception):  # a lost scheduler has nothing to cancel
            self._client.cancel(list(self._remote))


def cluster_executors(client: "Client", address: str) -> Executors:
    """Return executors on the cluster of a connected client; the address is for messages.

    Their `capacity` raises `CutShort` once the cluster, which has had workers, has been without any for a minute.
    """
    from distributed import KilledWorker

    @contextmanager
    def start() -> Iterator[Executor]:
        with _ClusterExecutor(client) as executor:
            yield executor

    seen: float | None = None

    def capacity() -> int:
        nonlocal seen
        threads = cast("dict[str, int]", client.nthreads())
        if threads:
            seen = time.monotonic()
        elif seen is not None and time.monotonic() - seen > WITHOUT_WORKERS:
            raise CutShort(
                f"--cluster {address}: all workers are lost, and none has come for {WITHOUT_WORKERS} s; finished files "
                "are kept: start workers and continue with --resume"
            )
        return TASKS_PER_WORKER * max(1, sum(threads.values()))

    return Executors(start, capacity, KilledWorker, lambda: _explained(client, address))


@contextmanager
def _explained(client: "Client", address: str) -> Iterator[None]:
    """Turn what Dask raises when the scheduler is lost into `CutShort` that says how to resume."""
    try:
        yield
    except CutShort:
        raise
    except Exception as error:
        # A client without its scheduler fails in many ways, some of them inside Dask.
        if client.status == "running" and not isinstance(error, CancelledError | OSError | RuntimeError):
            raise
        raise CutShort(
            f"--cluster {address}: the scheduler is lost ({type(error).__name__}); finished files are kept: start "
            "it again and continue with --resume"
        ) from None
