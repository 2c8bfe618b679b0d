"""One run at a time into one `--out`: a lock of the operating system, which ends with the process that holds it."""

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import removed_at_interrupt
from bayes_tyre.plain_text import one_line

if sys.platform == "win32":
    import msvcrt

    def _take(handle: int) -> None:
        os.lseek(handle, 1 << 30, os.SEEK_SET)  # a locked byte cannot be read, and the text is to be read
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _take(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def sole_run(out: Path | None) -> Iterator[None]:
    """Hold the lock of an `--out` for the block; without an `--out`, or where no file can be made, hold nothing.

    The lock is a file beside `out` (`.NAME.lock`), removed at the end. One that a killed process left is free: the
    system has released it.

    Raises
    ------
    BadInput
        If another run holds it; the message says which, and since when.
    """
    if out is None:
        yield
        return
    whole = out.resolve()
    made = [folder for folder in whole.parents if not folder.exists()]
    path = whole.with_name(f".{whole.name or 'root'}.lock")
    handle = None
    try:
        handle = _locked(path, out)
        if handle is None:
            yield
            return
        with removed_at_interrupt(path):
            yield
    finally:
        with suppress(OSError):
            if handle is not None:
                path.unlink(missing_ok=True)
                os.close(handle)
            for folder in made:  # those that hold nothing else
                folder.rmdir()


def _locked(path: Path, out: Path) -> int | None:
    """Return the handle of a lock that is held now; None where its file cannot be made, as on a read-only disk."""
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            return None
        try:
            _take(handle)
        except (BlockingIOError, PermissionError):
            os.lseek(handle, 0, os.SEEK_SET)
            holder = one_line(os.read(handle, 200).decode("utf-8", "replace"), 200)
            os.close(handle)
            raise BadInput(
                f"--out {out}: another run writes into it ({holder or 'started just now'}); wait until it ends, or "
                "give another --out"
            ) from None
        except OSError:  # a disk without locks
            os.close(handle)
            return None
        if _is_at(handle, path):
            break
        os.close(handle)  # its last holder removed the file between the opening and the lock
    since = datetime.now().astimezone().isoformat(" ", "seconds")
    with suppress(OSError):  # a full disk: the lock holds without its text
        os.ftruncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {platform.node()[:30]} since {since}"[:98].encode())
    return handle


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except OSError:
        return False
