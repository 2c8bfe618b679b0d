"""`process` by several processes or a cluster, killed and resumed: the bytes of one process left alone."""

import shutil
import subprocess
import sys
import time

import pytest
from helpers import own_cluster
from helpers.command_line import assert_refused, environment, here, start, tree_of
from helpers.dying_work import DEADLY, work
from helpers.process_recordings import GOOD, assert_same, files_processed, record_into

from bayes_tyre.embedded import data_path
from bayes_tyre.workflow.execution.batch import as_completed
from bayes_tyre.workflow.execution.executors import local_processes


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(processed, recordings, tmp_path):
    out, _, _ = processed
    command = here("process", recordings, "--out", tmp_path / "records.csv", "--workers", 2)
    assert command.exit_code == 0, command.stderr
    for name in ("records.csv", "rejected.csv"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


@pytest.mark.slow
def test_a_process_that_dies_loses_nothing_but_its_own_task():
    outcomes = dict(as_completed(local_processes(2), work, range(6)))
    assert "every process that worked on it died" in str(outcomes.pop(DEADLY))
    assert outcomes == {i: str(i) for i in range(6) if i != DEADLY}


@pytest.mark.slow
def test_resume_after_kill_gives_the_bytes_of_an_undisturbed_run(processed, recordings, tmp_path):
    options = ["--out", tmp_path / "records.csv", "--figures", tmp_path / "pictures", "--workers", 1]
    command = start("process", recordings, *options, cwd=tmp_path)
    while command.poll() is None and files_processed(tmp_path / "records.csv") < 2:
        time.sleep(0.005)
    command.kill()
    command.communicate()
    assert not (tmp_path / "records.csv").exists()
    assert here("process", recordings, *options, "--resume").exit_code == 0
    assert_same(processed[0], tmp_path)


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_and_what_it_did_outlives_its_scheduler(processed, recordings, tmp_path):
    lock = tmp_path / "lock"
    cluster = subprocess.Popen(
        [sys.executable, own_cluster.__file__, GOOD[0], lock], cwd=tmp_path, env=environment(), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with cluster:
        try:
            assert cluster.stdout is not None
            address = cluster.stdout.readline().strip()
            command = ["process", recordings, "--cluster", address, "--figures"]
            whole = here(*command, tmp_path / "a" / "pictures", "--out", tmp_path / "a" / "records.csv")
            assert whole.stderr == processed[2]
            assert whole.exit_code == 0
            assert_same(processed[0], tmp_path / "a")
            lsq = ["lsq", tmp_path / "a" / "records.csv", "--out"]
            assert here(*lsq, tmp_path / "on_cluster", "--cluster", address).exit_code == 0
            lock.touch()
            out = ["--out", tmp_path / "b" / "records.csv"]
            cut = start(*command, tmp_path / "b" / "pictures", *out, cwd=recordings)
            while cut.poll() is None and files_processed(out[1]) < 5:  # all but the one that waits
                time.sleep(0.01)
        finally:
            cluster.kill()
    assert here(*lsq, tmp_path / "here", "--workers", 1).exit_code == 0
    fits = [(tmp_path / name / "least_squares.csv").read_bytes() for name in ("on_cluster", "here")]
    assert fits[0] == fits[1]
    try:
        stdout, stderr = cut.communicate(timeout=300)
    finally:
        cut.kill()
    assert_refused(cut.returncode, stderr, "the scheduler is lost", "--resume")
    assert stdout == ""
    assert not (tmp_path / "b" / "records.csv").exists()
    resumed = here("process", recordings, *out, "--figures", tmp_path / "b" / "pictures", "--workers", 1, "--resume")
    assert resumed.exit_code == 0
    assert_same(processed[0], tmp_path / "b")


def another_rig(file, rig) -> list[str]:
    text = rig.read_text()
    rig.write_text(text.replace("1300", "1301"))
    assert rig.read_text() != text
    return []


def another_method(file, rig) -> list[str]:
    return ["--method", "thesis"]


def another_file(file, rig) -> list[str]:
    record_into(file.parent, 1, file.name)
    return []


@pytest.mark.parametrize("change", [another_rig, another_method, another_file])
def test_resume_heeds_another_file_rig_and_method(change, recordings, tmp_path):
    file, rig = tmp_path / GOOD[0], tmp_path / "rig.toml"
    shutil.copy(recordings / GOOD[0], file)
    rig.write_text(data_path("rigs/single.toml").read_text())

    def run(name, *options) -> bytes:
        done = here("process", file, "--rig", rig, "--workers", 1, "--out", tmp_path / name, *options)
        assert done.exit_code == 0, done.stderr
        return (tmp_path / name).read_bytes()

    before = run("r.csv")
    options = change(file, rig)
    after = run("r.csv", "--resume", *options)
    assert after != before
    assert after == run("fresh.csv", *options)


@pytest.mark.parametrize("address", ["tcp://nowhere", "", "bogus://x:1"])
def test_a_cluster_that_is_none_is_refused_and_nothing_written(address, recordings, tmp_path):
    refused = here("process", recordings, "--out", tmp_path / "new" / "r.csv", "--cluster", address)
    assert_refused(refused.exit_code, refused.stderr, "--cluster", "tcp://host:8786")
    assert tree_of(tmp_path) == {}


def test_a_cluster_and_workers_are_one_too_many(recordings, tmp_path):
    assert (
        here("process", recordings, "--out", tmp_path / "r.csv", "--cluster", "tcp://h:1", "--workers", 2).exit_code
        == 2
    )
