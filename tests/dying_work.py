"""Work for processes of their own, one of which dies; light to import, for each of them does."""

import os
import time

DEADLY = 3


def work(task: int) -> str:
    if task == DEADLY:
        os._exit(9)
    time.sleep(0.02)
    return str(task)
