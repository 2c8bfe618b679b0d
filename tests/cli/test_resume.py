"""`fit --resume` and `fit --from`: nothing sampled is lost, the same bytes come out, and other runs are refused."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.command_line import FEW as FEW_DRAWS
from helpers.command_line import LONGEST, TABLES, assert_refused, finish, here, small, start, tree_of, written

from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.workflow import fit as workflow

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

FEW = [*FEW_DRAWS, "--seed", 5]
SAME = (*TABLES, "diagnostics.json", "posterior.nc")
#: What is there when a run is killed: in warmup; between two files. (`test_checkpoint` has them all.)
MOMENTS = (".checkpoint/chunk-000000.npz", "cases.csv")
#: What a run leaves that is killed while it writes a table, the posterior, a figure or `run.json`.
HALF_WRITTEN = (
    ".contrasts.csv.u9738etp.csv",
    ".posterior.nc.5zq_c0de.nc",
    "figures/.pair_plot.png.abcd1234.png",
    ".run.json.01234567.json",
)


def killed(process: subprocess.Popen[str], appears: Path) -> None:
    """End a process by SIGKILL as soon as a file is there."""
    until = time.monotonic() + LONGEST
    while not appears.exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    process.kill()
    process.communicate()
    assert appears.exists()


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> Path:
    """Return a folder with a run left alone, `whole`, and `after/N`: the state after each kill, then all of it.

    The run left alone has a file in the place of its checkpoints, which stands for a disk that refuses them. The last
    of the others repeats it from its run.json, and goes on from where it was killed.
    """
    folder = tmp_path_factory.mktemp("runs")
    written(small(), folder / "records.csv")
    (folder / "whole").mkdir()
    (folder / "whole" / ".checkpoint").write_text("in the way")
    done = finish(start("fit", "records.csv", "--out", "whole", *FEW, cwd=folder))
    (folder / "whole said").write_text(done.stderr)
    assert done.returncode == 4, done.stderr
    (folder / "whole" / ".checkpoint").unlink()
    for number, moment in enumerate(MOMENTS):
        resume = ["--resume"] if number else []
        killed(start("fit", "records.csv", "--out", "cut", *FEW, *resume, cwd=folder), folder / "cut" / moment)
        shutil.copytree(folder / "cut", folder / "after" / str(number))
    for name in HALF_WRITTEN:  # whether a run is killed while it writes one of these is chance
        (folder / "cut" / name).parent.mkdir(exist_ok=True)
        (folder / "cut" / name).write_text("half")
    done = finish(start("fit", "--from", "whole/run.json", "--out", "cut", "--resume", cwd=folder))
    (folder / "cut said").write_text(done.stderr)
    assert done.returncode == 4, done.stderr
    return folder


@pytest.fixture
def no_work(monkeypatch) -> None:
    monkeypatch.setattr(workflow, "fit_hierarchical", lambda *_: pytest.fail("fitted again"))


def test_a_run_killed_twice_and_repeated_gives_the_bytes_of_one_left_alone(runs):
    for name in (*SAME, *(f"figures/{path.name}" for path in (runs / "whole" / "figures").iterdir())):
        assert (runs / "cut" / name).read_bytes() == (runs / "whole" / name).read_bytes(), name
    assert tree_of(runs / "cut").keys() == tree_of(runs / "whole").keys()
    reasons = json.loads((runs / "cut" / "diagnostics.json").read_text())["reasons"]
    assert (runs / "cut said").read_text() == "".join(f"bayes-tyre: {in_words(reason)}\n" for reason in reasons)
    one, other = (json.loads((runs / name / "run.json").read_text()) for name in ("whole", "cut"))
    for key in ("options", "seed", "versions", "origin"):
        assert one[key] == other[key]
    assert list(one["inputs"].values()) == list(other["inputs"].values())


def test_what_a_killed_run_leaves_is_whole_and_does_not_pass_for_a_result(runs):
    for number, moment in enumerate(MOMENTS):
        left = runs / "after" / str(number)
        assert (left / moment).stat().st_size > 0
        assert not (left / "run.json").exists()
    assert len(list((runs / "after" / "1" / ".checkpoint").glob("chunk-*"))) == 4


def test_a_finished_run_is_not_done_again(runs, no_work, monkeypatch):
    monkeypatch.chdir(runs)
    before = tree_of(runs / "whole")
    done = here("fit", "records.csv", "--out", "whole", *FEW, "--resume")
    assert done.exit_code == 4
    assert "bayes-tyre: whole: this run is finished; nothing is done again\n" in done.stderr
    assert "verdict fail" in done.stdout
    assert tree_of(runs / "whole") == before
    done = here("fit", "--from", "whole/run.json", "--out", "whole", "--resume", "--quiet")
    assert done.exit_code == 4
    assert "nothing is done again" not in done.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--draws", 171], "option draws was 170, is 171"),
        (["--chains", 3], "option chains was 2, is 3"),
        (["--region", "thesis"], "option region was all, is thesis"),
        (["--seed", 6], "seed was 5, is 6"),
    ],
)
@pytest.mark.parametrize("where", ["after/1", "whole"])
def test_another_run_in_the_folder_is_refused_with_the_difference(where, options, said, runs, no_work, monkeypatch):
    monkeypatch.chdir(runs)
    before = tree_of(runs / where)
    done = here("fit", "records.csv", "--out", where, *FEW, *options, "--resume")
    assert_refused(done.exit_code, done.stderr, where, said, "leave out --resume to begin anew")
    assert tree_of(runs / where) == before


def test_other_data_and_other_versions_are_refused_with_the_difference(runs, no_work, monkeypatch):
    monkeypatch.chdir(runs)
    written(small(seed=2), runs / "other.csv")
    done = here("fit", "other.csv", "--out", "after/1", *FEW, "--resume")
    assert_refused(done.exit_code, done.stderr, "after/1", "input other.csv: SHA-256 was ")
    monkeypatch.setattr("bayes_tyre.results.provenance.version", lambda name: "0.0" if name == "numpyro" else "1")
    done = here("fit", "records.csv", "--out", "after/1", *FEW, "--resume")
    assert_refused(done.exit_code, done.stderr, "after/1", "version of arviz was ", ", is 1")


def test_a_torn_first_checkpoint_is_refused_in_one_line(runs, no_work, tmp_path, monkeypatch):
    monkeypatch.chdir(runs)
    (tmp_path / ".checkpoint").mkdir()
    (tmp_path / ".checkpoint" / "chunk-000000.npz").write_bytes(b"PK torn")
    done = here("fit", "records.csv", "--out", tmp_path, *FEW, "--resume")
    assert_refused(done.exit_code, done.stderr, "no checkpoint that can be read", "leave out --resume to begin anew")


def test_without_a_checkpoint_or_without_resume_a_run_begins_anew_and_says_so(runs, tmp_path, monkeypatch):
    class Began(Exception):
        pass

    def began(*_: object) -> None:
        raise Began

    monkeypatch.setattr(workflow, "fit_hierarchical", began)
    monkeypatch.chdir(runs)
    for out, resume, said in (
        (tmp_path / "new", ["--resume"], "no checkpoint to resume from; the run starts from the beginning"),
        (tmp_path / "old", [], "an unfinished run is overwritten; --resume would have continued it"),
    ):
        if out.name == "old":
            shutil.copytree(runs / "after" / "1", out)
        heard: list[str] = []
        with monkeypatch.context() as ears:
            # The package's attribute of this name is the command, not its module.
            ears.setattr(sys.modules["bayes_tyre.cli.sampled"], "note", lambda text, quiet: heard.append(text))  # noqa: B023
            with pytest.raises(Began):
                here("fit", "records.csv", "--out", out, *FEW, *resume)
        assert len(heard) == 1
        assert heard[0].endswith(said)
        assert not (out / ".checkpoint").exists()


def test_a_repeated_run_needs_its_own_input_and_says_when_versions_differ(runs, no_work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = json.loads((runs / "whole" / "run.json").read_text())
    path = tmp_path / "result" / "run.json"
    path.parent.mkdir()

    def repeat(content: object) -> tuple[int, str]:
        path.write_text(json.dumps(content))
        done = here("fit", "--from", path, "--out", tmp_path / "out")
        return done.exit_code, done.stderr

    assert_refused(*repeat(run), "its input records.csv is not there")
    written(small(seed=2), tmp_path / "records.csv")
    assert_refused(*repeat(run), "records.csv", "SHA-256 was", "bring back the file")
    written(small(), tmp_path / "records.csv")
    assert_refused(*repeat(run | {"command": "bayes-tyre published --out x"}), "not by fit")
    assert_refused(*repeat(run | {"options": run["options"] | {"odd": 1}}), "option odd is unknown to this version")
    assert_refused(*repeat(run | {"options": {}}), "is not what fit writes")
    for other in ([], {}, {"command": "bayes-tyre fit"}, run | {"seed": "x"}, run | {"inputs": {}}):
        assert_refused(*repeat(other), "is not what fit writes")
    assert not (tmp_path / "out").exists()

    monkeypatch.setattr(
        workflow, "fit_hierarchical", lambda *_: (_ for _ in ()).throw(workflow.BadInput("ended; here"))
    )
    code, said = repeat(run | {"versions": run["versions"] | {"jax": "0.1"}})
    assert code == 3
    warning, refusal = said.splitlines()
    assert warning.startswith(f"bayes-tyre: warning: {path}: made with jax 0.1, now ")
    assert warning.endswith("the bytes may differ")
    assert refusal.endswith("ended; here")


@pytest.mark.parametrize(
    ("beside", "named"),
    [(["records.csv"], "RECORDS"), (["--draws", "99"], "--draws"), (["--seed", "5"], "--seed")],
)
def test_options_beside_from_are_a_contradiction(beside, named, runs, no_work, monkeypatch):
    monkeypatch.chdir(runs)
    done = here("fit", "--from", "whole/run.json", "--out", "never", *beside)
    assert done.exit_code == 2
    assert named in done.stderr
    assert "contradicts --from" in done.stderr
    assert not (runs / "never").exists()
    assert here("fit", "--out", "never").exit_code == 2


def test_a_disk_without_room_for_checkpoints_ends_no_run(runs):
    warnings = [line for line in (runs / "whole said").read_text().splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert warnings[0].startswith(f"bayes-tyre: warning: no more checkpoints ({Path('whole/.checkpoint')}")
    assert (runs / "whole" / "cases.csv").is_file()
