"""Writing files whole or not at all, and checking folders before the work."""

import errno
import os
import re
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import reason

# Files being written now, and the lock for starting or finishing one. Module state, because a signal reaches the
# process and not a function.
_unfinished: set[Path] = set()
_lock = threading.Lock()
# How `tempfile` names what `whole_file` asks it for.
_BESIDE = re.compile(r"\.(?P<name>.+)\.[a-z0-9_]{8}(?:\.[^.]*)?")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it takes its place only when the block ends without an error.

    Raises
    ------
    OSError
        With the name of the file that was to be written.
    """
    made = [folder for folder in path.parents if not folder.exists()]
    beside = None
    try:
        with _lock:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
            beside = Path(name)
            _unfinished.add(beside)
        os.close(handle)
        yield beside
        beside.chmod(0o666 & ~_umask())
        with _lock:
            beside.replace(path)
    except BaseException as error:
        with suppress(OSError):
            if beside is not None:
                beside.unlink(missing_ok=True)
            for folder in made:  # those that hold nothing else
                folder.rmdir()
        if isinstance(error, OSError):
            raise _named(error, path) from error
        raise
    finally:
        if beside is not None:
            _unfinished.discard(beside)


@contextmanager
def removed_at_interrupt(path: Path) -> Iterator[None]:
    """Have a file removed, as one that is being written, if the process is interrupted in the block."""
    _unfinished.add(path)
    try:
        yield
    finally:
        _unfinished.discard(path)


def remove_unfinished() -> None:
    """Remove every file that is being written, and block all others, because the process ends now."""
    _lock.acquire(timeout=2.0)  # s; a disk that hangs must not hold the process
    for beside in tuple(_unfinished):
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def remove_leftovers(paths: Iterable[Path]) -> None:
    """Remove what writers of these files left half-written beside them when they were killed."""
    names: dict[Path, set[str]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add(path.name)
    for folder, whole in names.items():
        for path in folder.iterdir() if folder.is_dir() else ():
            left = _BESIDE.fullmatch(path.name)
            if left is not None and left["name"] in whole:
                path.unlink(missing_ok=True)


def _named(error: OSError, path: Path) -> OSError:
    if error.errno is None:  # the library gave text only
        return OSError(errno.EIO, reason(error), str(path))
    return OSError(error.errno, os.strerror(error.errno), str(path))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(text: str, path: Path) -> Path:
    """Write UTF-8 text, whole or not at all; return the path. Bytes of a path that are no text become escapes."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8", errors="backslashreplace")
    return path


def write_bytes(content: bytes, path: Path) -> Path:
    """Write bytes, whole or not at all; return the path."""
    with whole_file(path) as beside:
        beside.write_bytes(content)
    return path


def check_folder(out: Path, option: str = "--out") -> None:
    """Refuse a folder that an option names and that cannot be made, before minutes of work and without making it.

    Raises
    ------
    BadInput
        If it is a file, lies below one, or lies where one may not write.
    """
    if any(path.exists() and not path.is_dir() for path in (out, *out.parents)):
        raise BadInput(f"{option} {out}: is a file, or lies below one; name a folder")
    there = next(path for path in (out.absolute(), *out.absolute().parents) if path.exists())
    try:  # permissions do not show read-only disks or places like /proc
        Path(tempfile.mkdtemp(dir=there, prefix=".bayes-tyre.")).rmdir()
    except OSError as error:
        raise BadInput(
            f"{option} {out}: {there} may not be written to ({error.strerror}); name a folder that you may write to"
        ) from None


def prepare_folder(out: Path) -> None:
    """Make the folder that results go into.

    Raises
    ------
    BadInput
        If it is a file or cannot be made.
    """
    check_folder(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {out}: {error.strerror}; name a folder that you may write to") from None
