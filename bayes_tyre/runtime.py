"""JAX's settings: float64, a host device a chain, a compilation cache, and how what runs once is compiled.

And the memory that compiling leaves behind.
"""

import ctypes
import os
import time
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

#: s; entries younger than this at the last check are checked again: another process may still have been writing them.
_WRITING = 60.0
#: Compiler options of what runs once: it compiles in half to two thirds of the time.
RUN_ONCE = {"xla_backend_optimization_level": 0}
#: Without the library that XLA's CPU backend hands sums to: on arrays of a hierarchy's size it adds half to the time of
#: a gradient, for each call divides its work among threads that other chains are using.
_WITHOUT_YNN = {"xla_cpu_experimental_ynn_fusion_type": ""}
#: Where Linux lists a process's memory maps and how many it grants; share of them, and of the memory that a process a
#: core has, above which compiled code is dropped.
_MAPS, _MAPS_GRANTED, _HELD_MOST = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count"), 0.5
#: Where Linux says how large a process is; GB that one may have in any case: two rigs by one law take that.
_STATM, _LEAST_GB = Path("/proc/self/statm"), 2.5


@cache
def run_often() -> dict[str, str]:
    """Return the compiler options of what runs thousands of times; none where this XLA does not know them."""
    import jax

    try:
        jax.jit(lambda x: x).lower(0.0).compile(compiler_options=_WITHOUT_YNN)
    except jax.errors.JaxRuntimeError:
        return {}
    return _WITHOUT_YNN


def prepare_jax(devices: int = 1, device: str | None = None) -> None:
    """Switch JAX to float64 and split the host into `devices`, so that as many chains run in parallel.

    Call it before the first computation: the number of devices is fixed when JAX starts. Where JAX has started
    already, the devices stay as they are (chains then run one after another) and only float64 is set. What JAX
    compiles is cached in the user's cache folder for the next run, unless JAX's own variables are set:
    JAX_COMPILATION_CACHE_DIR names another folder, JAX_ENABLE_COMPILATION_CACHE=0 turns the cache off. Likewise
    JAX_NUM_CPU_DEVICES: what is compiled for one number of devices does not serve another.

    Parameters
    ----------
    devices:
        How many devices the host is split into.
    device:
        ``cpu``: what JAX computes on, unless it has started already; anything else: a GPU where it finds one.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    if jax.config.jax_enable_compilation_cache and not jax.config.jax_compilation_cache_dir:
        _set_compilation_cache()
    if device == "cpu":
        jax.config.update("jax_platforms", device)
    if "JAX_NUM_CPU_DEVICES" not in os.environ:
        try:
            jax.config.update("jax_num_cpu_devices", devices)
        except RuntimeError as error:
            if "backends" not in str(error):
                raise


def finds_gpu() -> bool:
    """Return whether JAX computes on a GPU; this starts JAX."""
    import jax

    return jax.default_backend() == "gpu"


def return_freed_memory() -> None:
    """Give memory that was freed back to the system where the C library keeps it, as glibc does.

    Compilers in several threads leave it in pieces: without this a process of 0.8 GB holds 2 GB after a few fits.
    """
    with suppress(AttributeError, OSError, TypeError):  # other C libraries have no such function, or need none
        ctypes.CDLL(None).malloc_trim(0)


def drop_code_where_full() -> None:
    """Drop what JAX has compiled where it fills half of this process's memory maps, or its share of the memory.

    LLVM ends a process that has no map left. What fits a rolling record takes some 25,000 of the usual 65,530 maps and
    a GB when it is compiled, for each rig and force law; read from the compilation cache it takes a third of that.
    """
    if _fills_maps() or _fills_memory():
        import jax

        jax.clear_caches()
        return_freed_memory()


def _fills_maps() -> bool:
    try:
        with _MAPS.open("rb") as maps:
            held = sum(1 for _ in maps)
        return held > _HELD_MOST * int(_MAPS_GRANTED.read_text())
    except (OSError, ValueError):  # another system
        return False


def _fills_memory() -> bool:
    """Return whether this process is larger than half of the memory divided among the cores, and than `_LEAST_GB`."""
    try:
        pages = int(_STATM.read_text().split()[1])
        memory = os.sysconf("SC_PHYS_PAGES")
    except (OSError, ValueError, IndexError):  # another system
        return False
    share = _HELD_MOST * memory / (os.cpu_count() or 1)
    return pages > max(share, _LEAST_GB * 1e9 / os.sysconf("SC_PAGE_SIZE"))


def _set_compilation_cache() -> None:
    """Set JAX's compilation cache; without a folder that can be written, JAX compiles anew each time."""
    import jax

    try:
        folder = user_cache_path("bayes-tyre", appauthor=False) / f"jax-{jax.__version__}"
        folder.mkdir(parents=True, exist_ok=True)
        remove_truncated(folder)
    except (OSError, RuntimeError):  # no room, no permission, or no home folder
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def remove_truncated(folder: Path) -> None:
    """Remove truncated entries, left by a run that was killed: JAX never replaces an entry that it cannot read.

    JAX writes entries in place. Two runs that write at once write the same bytes.
    """
    checked, now = folder / "looked-at", time.time()
    since = checked.stat().st_mtime - _WRITING if checked.exists() else 0.0
    checked.touch()
    for entry in folder.glob("*-cache"):
        with suppress(OSError):  # another run may be removing it too
            if entry.stat().st_mtime >= since and not _is_whole(entry.read_bytes()):
                entry.unlink(missing_ok=True)
    os.utime(checked, (now, now))  # when the check began


def _is_whole(entry: bytes) -> bool:
    """Return whether an entry can be decompressed; entries not from zlib are checked by the library that wrote them."""
    if entry[:1] != b"\x78":
        return bool(entry)
    try:
        zlib.decompress(entry)
    except zlib.error:
        return False
    return True
