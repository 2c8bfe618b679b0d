"""JAX's settings, made once by a command before anything computes: float64, a host device a chain, code kept."""

import os
import sys
import time
import zlib
from contextlib import suppress
from pathlib import Path

#: Of the time from one look at the kept code to the next, s: what another process is still writing is looked at again.
_WRITING = 60.0


def prepare_jax(devices: int = 1) -> None:
    """Switch JAX to float64 and split the host into `devices`, so that as many chains run side by side.

    Call it before the first computation: the number of devices is fixed when JAX starts. Where JAX has started
    already, the devices stay as they are (chains then run one after another) and only float64 is set. What JAX
    compiles is kept in the user's cache folder for the next run, unless JAX's own variables say otherwise:
    JAX_COMPILATION_CACHE_DIR another folder, JAX_ENABLE_COMPILATION_CACHE=0 none.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    if jax.config.jax_enable_compilation_cache and not jax.config.jax_compilation_cache_dir:
        _keep_compiled()
    try:
        jax.config.update("jax_num_cpu_devices", devices)
    except RuntimeError as error:
        if "backends" not in str(error):
            raise


def cache_folder() -> Path:
    """Return where a user's programs keep what can be made again."""
    if given := os.environ.get("XDG_CACHE_HOME", ""):
        return Path(given) / "bayes-tyre"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "bayes-tyre" / "Cache"
    return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "bayes-tyre"


def _keep_compiled() -> None:
    """Let JAX keep what it compiles; where the folder cannot be had, it compiles anew each time."""
    import jax

    try:
        folder = cache_folder() / f"jax-{jax.__version__}"
        folder.mkdir(parents=True, exist_ok=True)
        _remove_torn(folder)
    except (OSError, RuntimeError):  # no place for it, or not even a home
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def _remove_torn(folder: Path) -> None:
    """Remove entries that a run killed while writing has left: JAX would read them in vain for ever.

    JAX writes them in place. What two runs write at a time is the same, and JAX compiles what it cannot read.
    """
    looked, now = folder / "looked-at", time.time()
    since = looked.stat().st_mtime - _WRITING if looked.exists() else 0.0
    looked.touch()
    for entry in folder.glob("*-cache"):
        with suppress(OSError):  # another run may be removing it too
            if entry.stat().st_mtime >= since and not _whole(entry.read_bytes()):
                entry.unlink(missing_ok=True)
    os.utime(looked, (now, now))  # when the look began


def _whole(entry: bytes) -> bool:
    """Return whether an entry can be unpacked; what is not zlib's, JAX packed by another library, which checks it."""
    if entry[:1] != b"\x78":
        return bool(entry)
    try:
        zlib.decompress(entry)
    except zlib.error:
        return False
    return True
