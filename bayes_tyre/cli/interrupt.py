"""Ctrl-C ends a command at once, with one line and nothing half-written, whichever library is running."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from bayes_tyre.cli.messages import fault
from bayes_tyre.formats.files import remove_unfinished

#: Exit code of an interrupted command, as shells report it.
INTERRUPTED = 130


@contextmanager
def ending_at_interrupt(advice: str = "run the command again") -> Iterator[None]:
    """End the process at Ctrl-C from a thread that receives the signal itself; print advice on how to continue.

    Python's own way, an exception in the main thread, fails in three places: it waits for XLA, which samples for
    minutes; it is lost in JAX's callbacks; and it aborts the process while a compiled module is imported.
    """
    # A parent process may have set SIGINT to be ignored.
    has_default_handler = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not has_default_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    thread = threading.Thread(target=_end_at_interrupt, args=(receiver, advice), daemon=True)
    previous_fd = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, lambda *_: None)
    thread.start()
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(previous_fd)
        sender.close()
        thread.join()
        receiver.close()


def _end_at_interrupt(receiver: socket.socket, advice: str) -> None:
    while signals := receiver.recv(1):
        if signals[0] == signal.SIGINT:
            remove_unfinished()
            if sys.stderr.isatty():
                sys.stderr.write("\r\x1b[2K\x1b[?25h")  # clear the progress bar's line and show the cursor
            fault(f"interrupted; nothing half-written is left, {advice}")
            os._exit(INTERRUPTED)
