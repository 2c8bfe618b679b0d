"""Resuming in a folder of another run is refused, or samples again where the expensive results are cached elsewhere."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling import checkpoint
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.chunks import Chunk
from bayes_tyre.results.provenance import Run, begin_run, difference, write_run
from bayes_tyre.workflow.execution.resume import CHECKPOINTS, Callbacks, open_checkpoints

RUN = begin_run(["motion", "raw"], {"draws": 100}, 0, [], "simulated")
OTHER = replace(RUN, options={"draws": 200})


def saved(folder: Path, run: Run) -> None:
    chunk = Chunk((np.zeros(2),), {"k": np.zeros((2, 5))}, {})  # pyright: ignore[reportArgumentType]  (any arrays do)
    Checkpoints(folder / CHECKPOINTS, run.identity).save(0, chunk)


def left_by(what: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Leave in a folder what another run might have, and return what is to be said of it."""
    if what == "a result":
        write_run(OTHER, folder)
        return "run.json: is of another run: option draws was 200, is 100"
    if what == "checkpoints":
        saved(folder, OTHER)
        return ".checkpoint: is of another run: option draws was 200, is 100"
    with monkeypatch.context() as older:
        older.setattr(checkpoint, "FORMAT", checkpoint.FORMAT - 1)
        saved(folder, RUN)
    return "states and draws mean something else"


@pytest.mark.parametrize("what", ["a result", "checkpoints", "checkpoints of another format"])
def test_what_another_run_left_is_refused_and_stays(what, tmp_path, monkeypatch):
    expected = left_by(what, tmp_path, monkeypatch)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(BadInput, match="leave out --resume to begin anew") as caught:
        open_checkpoints(tmp_path, RUN, Callbacks(), True)
    assert expected in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("what", ["a result", "checkpoints", "checkpoints of another format"])
def test_where_the_dear_part_is_elsewhere_it_is_told_and_the_draws_are_made_anew(what, tmp_path, monkeypatch):
    expected, said = left_by(what, tmp_path, monkeypatch), []
    found = open_checkpoints(tmp_path, RUN, Callbacks(warn=said.append), True, overwrite=True)
    assert isinstance(found, Checkpoints)
    assert not found.exist()
    assert len(said) == 1
    assert expected in said[0]
    assert said[0].endswith(": sampling starts again")


def test_ones_own_checkpoints_are_gone_on_with_either_way(tmp_path):
    saved(tmp_path, RUN)
    for over in (False, True):
        found = open_checkpoints(tmp_path, RUN, Callbacks(warn=lambda said: pytest.fail(said)), True, overwrite=over)
        assert isinstance(found, Checkpoints)
        assert found.exist()


def test_the_input_that_differs_is_named_with_its_own_digests():
    one = replace(RUN, inputs={"records.csv": "a" * 64, "map.toml": "b" * 64})
    other = replace(one, inputs={"records.csv": "a" * 64, "map.toml": "c" * 64})
    said = difference(one.identity, other.identity)
    assert said == f"input map.toml: SHA-256 was {'b' * 12}..., is {'c' * 12}..."
