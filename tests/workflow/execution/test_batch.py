"""Batches: cached as they are done, resumed, on a cluster that loses workers, in bounded memory."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from helpers import dying_work
from helpers.dying_work import ALIVE, DEADLY, Task, make

from bayes_tyre.errors import BadInput, CutShort
from bayes_tyre.workflow.execution import cluster as cluster_module
from bayes_tyre.workflow.execution.batch import Machines, as_completed, cached_tables, run_batch
from bayes_tyre.workflow.execution.cluster import check_versions, cluster_executors, connected
from bayes_tyre.workflow.execution.outcome import Fault
from bayes_tyre.workflow.execution.task_cache import TaskCache

HERE = Machines(workers=1)


def tasks_of(folder: Path, texts, **options) -> list[Task]:
    folder.mkdir(exist_ok=True)
    paths = [folder / f"{i}.lvm" for i in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    return [Task(path, **options) for path in paths]


def run(tasks, out, machines=HERE, work=make):
    made = []

    def counted(task):
        made.append(task.file.name)
        return work(task)

    progress = []
    outcomes = run_batch(counted if machines.workers == 1 else work, tasks, TaskCache(out), machines, progress.append)
    assert sum(progress) == len(tasks)
    return outcomes, made


def contents(outcomes) -> list[bytes | str]:
    return [end.reason if isinstance(end, Fault) else end.read_bytes() for end in outcomes]


def resumed(tasks, out):
    return run(tasks, out, HERE._replace(resume=True))


def test_what_is_done_is_not_done_again_and_what_changed_is(tmp_path):
    out, tasks = tmp_path / "records.csv", tasks_of(tmp_path / "raw", ["a", "bad", "c"])
    first, made = run(tasks, out)
    assert len(made) == 3
    again, made = resumed(tasks, out)
    assert (made, contents(again)) == ([], contents(first))
    tasks[1].file.write_text("mended")
    assert resumed(tasks, out)[1] == ["1.lvm"]
    more = tasks_of(tmp_path / "raw", ["a", "mended", "c", "d"])
    assert resumed(more, out)[1] == ["3.lvm"]
    assert run(more, out)[1] == ["0.lvm", "1.lvm", "2.lvm", "3.lvm"]  # without --resume an earlier run counts nothing


def test_tables_of_simulated_data_sets_are_cached_and_a_process_that_dies_ends_the_study(tmp_path):
    cache, progress = TaskCache(tmp_path / "study.csv"), []
    cache.prepare(False, ())
    tasks = {f"key{i}": i for i in range(DEADLY + 2) if i != DEADLY}
    parts = cached_tables(dying_work.tabulate, tasks, cache, progress.append, workers=2)
    assert [pd.read_parquet(part)["task"].item() for part in parts] == list(tasks.values())
    with pytest.raises(BadInput, match=r"two processes died at a data set.*--resume --workers 1"):
        cached_tables(
            dying_work.tabulate, {**tasks, "last": DEADLY + 2, "deadly": DEADLY}, cache, progress.append, workers=2
        )
    # What is cached is not computed again: here by a function that could not.
    progress.clear()
    assert cached_tables(lambda _: pd.DataFrame(), tasks, cache, progress.append) == parts
    assert progress == [1] * len(tasks)


def test_a_picture_that_is_missing_or_another_is_drawn_again(tmp_path):
    figure = tmp_path / "pictures" / "0.png"
    out, tasks = tmp_path / "records.csv", tasks_of(tmp_path / "raw", ["a"], figure=figure)
    run(tasks, out)
    assert resumed(tasks, out)[1] == []
    for spoil in (figure.unlink, lambda: figure.write_bytes(b"another")):
        spoil()
        assert resumed(tasks, out)[1] == ["0.lvm"]
        assert figure.read_bytes() == b"png"


def test_a_part_cut_short_and_leftovers_of_a_killed_run_do_no_harm(tmp_path):
    out, tasks = tmp_path / "records.csv", tasks_of(tmp_path / "raw", ["a", "bad"])
    first = contents(run(tasks, out)[0])
    for part in TaskCache(out).folder.iterdir():
        part.write_bytes(part.read_bytes()[:-5] if part.suffix == ".part" else b"")
    (TaskCache(out).folder / ".x.part.abcd1234.part").touch()
    again, made = resumed(tasks, out)
    assert (contents(again), len(made)) == (first, 2)
    assert not [path for path in TaskCache(out).folder.iterdir() if path.name.startswith(".")]


def test_a_fault_that_may_pass_is_not_kept(tmp_path):
    out, tasks = tmp_path / "records.csv", tasks_of(tmp_path / "raw", ["a"])
    outcomes, _ = run(tasks, out, work=lambda task: Fault("the disk is away", lasting=False))
    assert outcomes == [Fault("the disk is away", lasting=False)]
    assert resumed(tasks, out)[1] == ["0.lvm"]


def test_what_was_done_before_an_error_stays_done(tmp_path):
    out, tasks = tmp_path / "records.csv", tasks_of(tmp_path / "raw", ["a", "b", "c"])

    def failing(task):
        if task.file.name == "1.lvm":
            raise OSError(28, "No space left on device")
        return make(task)

    with pytest.raises(OSError, match="No space"):
        run(tasks, out, work=failing)
    assert resumed(tasks, out)[1] == ["1.lvm", "2.lvm"]


@pytest.mark.slow
def test_no_more_results_are_held_than_are_out_whatever_their_number(tmp_path):
    """Two processes with two tasks each: 4 results may wait, and one be written; 40 files would be 40."""
    ALIVE.clear()
    run(tasks_of(tmp_path / "raw", list(map(str, range(40)))), tmp_path / "records.csv", Machines(workers=2))
    assert ALIVE["ever"] == 40
    assert ALIVE["now"] == 0
    assert 1 <= ALIVE["most"] <= 5


@contextmanager
def local_cluster() -> Iterator[Any]:
    """Yield a scheduler with two worker processes of one thread."""
    from dask import config
    from distributed import LocalCluster

    folder = str(Path(dying_work.__file__).parent)
    preload = f"import sys; sys.path.insert(0, {folder!r})"
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": logging.CRITICAL}
    # Two deaths are enough, for each costs the start of a process.
    with (
        config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(processes=True, preload=preload, **options) as cluster,
    ):
        yield cluster


@pytest.fixture(scope="module")
def cluster():
    """Return a cluster whose workers no test kills."""
    with local_cluster() as cluster:
        yield cluster


@pytest.mark.slow
def test_a_cluster_loses_nothing_but_a_file_that_kills_every_worker(tmp_path):
    texts = ["a", "b", "once", "deadly", *map(str, range(8)), "bad"]
    (tmp_path / "deaths").mkdir()
    tasks = tasks_of(tmp_path / "raw", texts, deaths=tmp_path / "deaths")
    with local_cluster() as cluster:  # of its own: a worker that dies may not come back
        outcomes, _ = run(tasks, tmp_path / "records.csv", Machines(cluster=cluster.scheduler_address))
    assert isinstance(outcomes[3], Fault)
    assert "every process that worked on it died" in outcomes[3].reason
    kept = [task for i, task in enumerate(tasks) if i != 3]
    alone, _ = run(kept, tmp_path / "alone.csv")
    assert contents([*outcomes[:3], *outcomes[4:]]) == contents(alone)
    assert len(list((tmp_path / "deaths").iterdir())) > 1


@pytest.mark.slow
def test_no_more_results_come_from_a_cluster_than_are_out(cluster, tmp_path):
    """Two threads with two futures each; one more may be written."""
    ALIVE.clear()
    tasks = tasks_of(tmp_path / "raw", list(map(str, range(30))))
    run(tasks, tmp_path / "records.csv", Machines(cluster=cluster.scheduler_address))
    assert ALIVE["ever"] == 30
    assert 1 <= ALIVE["most"] <= 5


def test_a_lost_scheduler_is_named_with_how_to_resume(cluster, tmp_path):
    """As Dask's client does after its timeout, here while a result is being written."""
    with connected(cluster.scheduler_address) as client:
        outcomes = as_completed(
            cluster_executors(client, "tcp://s"), make, tasks_of(tmp_path, list(map(str, range(20))))
        )
        next(outcomes)
        client.close()
        with pytest.raises(BadInput, match=r"tcp://s: the scheduler is lost .* finished files are kept: .* --resume"):
            list(outcomes)


def test_a_cluster_that_has_lost_all_workers_ends_the_run_after_the_stated_wait(monkeypatch, tmp_path):
    from distributed import LocalCluster

    monkeypatch.setattr(cluster_module, "WITHOUT_WORKERS", 2)
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    own = LocalCluster(silence_logs=logging.CRITICAL, **options)
    with own, connected(own.scheduler_address) as client:
        tasks = tasks_of(tmp_path, list(map(str, range(300))))
        outcomes = as_completed(cluster_executors(client, "tcp://s"), dying_work.slowly, tasks)
        next(outcomes)
        own.scale(0)
        with pytest.raises(CutShort, match=r"all workers are lost, and none has come for 2 s; finished .* --resume"):
            list(outcomes)


def test_a_result_that_cannot_be_fetched_any_more_is_an_error_not_a_wait(cluster, monkeypatch):
    """As where a worker dies with the result of a task, and the task fails when it is repeated."""

    async def lost(*_: object, **__: object) -> None:
        raise ConnectionError("lost")

    with connected(cluster.scheduler_address) as client:
        monkeypatch.setattr(client, "_gather", lost)
        with cluster_executors(client, "tcp://s").start() as executor:
            with pytest.raises(ConnectionError, match="lost"):
                executor.submit(abs, -1).result(timeout=30)
            monkeypatch.undo()
            assert executor.submit(abs, -1).result(timeout=30) == 1


def versions(**theirs) -> dict:
    ours = {"python": "3.13.0.final.0", "distributed": "1", "bayes-tyre": "1", "numpy": "2"}
    return {"client": {"packages": ours}, "workers": {"tcp://w": {"packages": ours | theirs}}}


def test_other_versions_are_refused_or_told():
    check_versions(versions(python="3.13.1.final.0"), "tcp://s")
    for theirs in ({"bayes-tyre": "2"}, {"bayes-tyre": None}, {"distributed": "2"}, {"python": "3.12.0.final.0"}):
        with pytest.raises(BadInput, match=r"worker tcp://w has .*, here is .*; install the same"):
            check_versions(versions(**theirs), "tcp://s")
    with pytest.warns(UserWarning, match="last digits may differ"):
        check_versions(versions(numpy="3"), "tcp://s")
    with pytest.warns(UserWarning, match="no workers yet"):
        check_versions(versions() | {"workers": {}}, "tcp://s")
