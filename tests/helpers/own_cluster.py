"""A Dask cluster in a separate process, which can be killed: ``python own_cluster.py FILE LOCK``.

Its first line is the address. Work on a file of that name waits as long as there is a file LOCK.
"""

import sys
import time
from pathlib import Path

from bayes_tyre.workflow.raw import process

process_file = process.process_file


def waiting(task: process.Task):
    name, lock = sys.argv[1:]
    while task.file.name == name and Path(lock).exists():
        time.sleep(0.01)
    return process_file(task)


if __name__ == "__main__":
    from distributed import LocalCluster

    process.process_file = waiting
    options = {"processes": False, "protocol": "tcp", "dashboard_address": None}
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, **options)
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()  # until it is closed
