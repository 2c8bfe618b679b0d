"""Every test runs in float64 with jaxtyping checked by beartype; both are set before anything imports jax."""

import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import psutil
import pytest
from hypothesis import settings
from jaxtyping import install_import_hook
from platformdirs import user_cache_path

os.environ["JAX_ENABLE_X64"] = "1"
# The number of devices is part of an entry's key in the compilation cache: commands that the tests start find what was
# compiled here, and the other way round, only where the number is one.
os.environ["JAX_NUM_CPU_DEVICES"] = "4"
# Most of the suite's time is compilation, of the same kernels in each worker, in each command that the tests start and
# in the next run: all are cached, the small ones too, in a folder of the user's that all of them find here.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(user_cache_path("bayes-tyre", appauthor=False) / "tests"))
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
# Most take longer to compile than to run here; without LLVM's optimisation compiling takes half as long.
os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"
#: Days after which an entry of that cache is compiled anew.
CACHED_DAYS = 30
#: A worker above this drops what it has compiled.
MOST_BYTES = 3_000_000_000
#: `.ci/run`, which is ended after 90 minutes, says until when slow tests may begin, in seconds since the epoch.
SLOW_TESTS_UNTIL = float(os.environ.get("SLOW_TESTS_UNTIL", "inf"))
IN_SLOW_FILE = pytest.StashKey[bool]()
# Tracing leaves objects by the million, most without cycles: by Python's own thresholds minutes go by in collecting
# them. What grows all the same is dropped by `little_kept_compiled`.
gc.set_threshold(50_000, 20, 50)
# The same examples in every run, however long one takes beside the compiler.
settings.register_profile("same examples", deadline=None, derandomize=True)
settings.load_profile("same examples")
#: Steps in plain Python: a record takes a million calls or two of a microsecond each, which checking makes several.
#: Pyright alone checks what is handed on within it; what others hand it is made, and checked, elsewhere.
UNCHECKED = {"bayes_tyre.studies.motion_machine"}


class Unchecked(PathFinder):
    """Finds modules before the import hook does, which would have them checked at each call."""

    @classmethod
    def find_spec(cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None):
        return super().find_spec(fullname, path, target) if fullname in UNCHECKED else None


install_import_hook("bayes_tyre", "beartype.beartype")
sys.meta_path.insert(0, Unchecked)
# A shell that starts the tests in the background has them ignore Ctrl-C, and so would every command that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Remove what a killed run left truncated in the compilation cache, and what is old, before the workers start."""
    if hasattr(config, "workerinput"):
        return
    from bayes_tyre.runtime import remove_truncated

    folder = Path(os.environ["JAX_COMPILATION_CACHE_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    remove_truncated(folder)
    for entry in folder.glob("*-cache"):
        if entry.stat().st_mtime < time.time() - CACHED_DAYS * 86400:
            entry.unlink(missing_ok=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files with slow tests first: the last of them would else keep one worker alone at the end.

    Where time may run out they come last, so that every fast test is run, and those left over are skipped by name.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    slow_first = math.isinf(SLOW_TESTS_UNTIL)
    items.sort(key=lambda item: (item.path in slow) is not slow_first)
    for item in items:
        item.stash[IN_SLOW_FILE] = item.path in slow


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what is left of files with slow tests, whose fast ones share their fits, once time is over."""
    if time.time() > SLOW_TESTS_UNTIL and item.stash[IN_SLOW_FILE]:
        pytest.skip(f"the machine is too slow: no time left for {item.path.name}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Escape what no encoding has: a worker cannot send it, and would end with the whole run."""
    report = yield
    report.sections = [(title, _encodable(text)) for title, text in report.sections]
    if report.longrepr is not None and not isinstance(report.longrepr, tuple):
        report.longrepr = _encodable(str(report.longrepr))
    return report


def _encodable(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


@pytest.fixture(scope="module", autouse=True)
def little_kept_compiled() -> Iterator[None]:
    """Drop what JAX has compiled once it fills gigabytes: a worker runs a hundred modules, few share a kernel."""
    yield
    if "jax" in sys.modules and psutil.Process().memory_info().rss > MOST_BYTES:
        import jax

        jax.clear_caches()
        gc.collect()


@pytest.fixture(scope="module")
def fully_compiled() -> Iterator[None]:
    """Have a module's kernels compiled as users have them: for those that run for longer than that takes."""
    import jax

    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)


@pytest.fixture(scope="module")
def iterations_fully_compiled() -> Iterator[None]:
    """Have the iterations of NUTS alone compiled as users have them: all else of a fit runs once or a few times.

    What one fit compiles takes 24 s of a core so, 42 s in full, and 21 s without optimisation. That what runs a few
    times is right when fully compiled is tested in `test_marginal_mixture` and `test_hierarchical_fit`.
    """
    from bayes_tyre.inference.sampling.chain_devices import ChainDevices
    from bayes_tyre.inference.sampling.nuts import Chains

    mapped = ChainDevices.mapped

    def mapped_in_full(devices: ChainDevices, function: Callable[[Any, Any], Any]) -> Any:
        jitted = mapped(devices, function)
        return _InFull(jitted) if getattr(function, "__func__", None) is Chains._sample else jitted

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(ChainDevices, "mapped", mapped_in_full)
        yield


class _InFull:
    """A jitted function whose lowered form is compiled with the options that `JAX_DISABLE_MOST_OPTIMIZATIONS` sets."""

    def __init__(self, jitted: Any) -> None:
        self._jitted = jitted

    def lower(self, *arguments: Any) -> Any:
        lowered = self._jitted.lower(*arguments)
        options = {"xla_backend_optimization_level": 3, "xla_llvm_disable_expensive_passes": False}
        return SimpleNamespace(
            compile=lambda compiler_options: lowered.compile(compiler_options=compiler_options | options)
        )


@pytest.fixture(scope="module")
def without_figures() -> Iterator[None]:
    """Have a module's results written without figures, which take seconds each: for tests that look at none."""
    from bayes_tyre.report.figures import catalogue

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        yield
