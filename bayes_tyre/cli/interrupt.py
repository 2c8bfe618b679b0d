"""Ctrl-C: a command ends at once, with one line and nothing half-written, in whatever library it is."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from bayes_tyre.cli.messages import fault
from bayes_tyre.formats.files import take_back_for_good

#: What a shell reports of a command that was interrupted.
INTERRUPTED = 130


@contextmanager
def heeding_interrupts(advice: str = "run the command again") -> Iterator[None]:
    """End the process at Ctrl-C, from a thread that hears the signal itself, with advice on how to go on.

    Python's own way, an exception in the main thread, does not serve: it waits for XLA, which samples for
    minutes, is lost in JAX's callbacks, and aborts the process where it meets a compiled module being imported.
    """
    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not so where a parent process ignores it
    if not usual or threading.current_thread() is not threading.main_thread():
        yield
        return
    hear, tell = socket.socketpair()
    tell.setblocking(False)
    thread = threading.Thread(target=_watch, args=(hear, advice), daemon=True)
    before = signal.set_wakeup_fd(tell.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, lambda *_: None)
    thread.start()
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(before)
        tell.close()
        thread.join()
        hear.close()


def _watch(hear: socket.socket, advice: str) -> None:
    while heard := hear.recv(1):
        if heard[0] == signal.SIGINT:
            take_back_for_good()
            if sys.stderr.isatty():
                sys.stderr.write("\r\x1b[2K\x1b[?25h")  # where a bar was drawn: its line, and the cursor that it hid
            fault(f"interrupted; nothing half-written is left, {advice}")
            os._exit(INTERRUPTED)
