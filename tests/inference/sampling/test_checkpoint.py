"""Checkpoints: from any of them a run goes on to the same bits; what is torn or another's is never used."""

import errno
import io
import os
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from helpers.small_model import DATA, SETTINGS, STARTS, assert_same, model

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.arrays import read_arrays, write_arrays
from bayes_tyre.inference.sampling import checkpoint
from bayes_tyre.inference.sampling import run as sampling
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.chunks import Chunk
from bayes_tyre.inference.sampling.run import sample

IDENTITY = {"options": {"draws": 4}, "seed": 1}


class State(NamedTuple):
    """What a sampler's state is to a checkpoint: a tree of arrays."""

    i: np.ndarray
    z: dict[str, np.ndarray]


def chunk(number: int, length: int = 5) -> Chunk:
    rng = np.random.default_rng(number)
    state = State(np.full(2, number), {"k": rng.normal(size=(2, 3))})
    return Chunk(state, {"k": rng.normal(size=(2, length, 3))}, {"file": rng.random((2, length)) < 0.5})  # pyright: ignore[reportArgumentType]


def saved(folder: Path, said: list[str] | None = None) -> Checkpoints:
    checkpoints = Checkpoints(folder, IDENTITY, [].append if said is None else said.append)
    for number in range(3):
        checkpoints.save(number, chunk(number))
    return checkpoints


def assert_chunk(one: Chunk, other: Chunk) -> None:
    assert type(one.state) is type(other.state)
    np.testing.assert_array_equal(one.state.z["k"], other.state.z["k"])  # pyright: ignore[reportArgumentType, reportCallIssue]
    np.testing.assert_array_equal(one.unconstrained["k"], other.unconstrained["k"])
    np.testing.assert_array_equal(one.statistics["file"], other.statistics["file"])


def test_chunks_come_back_as_they_were(tmp_path):
    checkpoints = saved(tmp_path / "c")
    assert checkpoints.identity_found() == IDENTITY
    found = checkpoints.load(chunk(0).state, [5] * 4)
    assert len(found) == 3
    for number, one in enumerate(found):
        assert_chunk(one, chunk(number))


def test_clearing_leaves_no_folder_but_what_others_put_there(tmp_path):
    saved(tmp_path / "c").clear()
    assert not (tmp_path / "c").exists()
    checkpoints = saved(tmp_path / "c")
    (tmp_path / "c" / "mine").write_text("mine")
    checkpoints.clear()
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["mine"]
    assert not checkpoints.exist()
    assert checkpoints.identity_found() is None


def entry_exchanged(whole: bytes, content: bytes) -> bytes:
    exchanged = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(exchanged, "w") as new:
        for name in old.namelist():
            new.writestr(name, content if name == "format.npy" else old.read(name))
    return exchanged.getvalue()


SPOILT = {
    "empty": lambda whole: b"",
    "half": lambda whole: whole[: len(whole) // 2],
    "one bit": lambda whole: whole[:900] + bytes([whole[900] ^ 1]) + whole[901:],
    "zeros": lambda whole: bytes(len(whole)),
    "text": lambda whole: b"record,displacement_mm\n",
    "a name that is not printable": lambda whole: b"\x01tatistics".join(whole.rsplit(b"statistics", 1)),
    "an entry that is no array": lambda whole: entry_exchanged(whole, b"6"),
    "a header that is no Python": lambda whole: entry_exchanged(whole, b"\x93NUMPY\x01\x00\x06\x00'descr"),
}


@pytest.mark.parametrize("how", SPOILT)
def test_a_spoilt_checkpoint_is_told_and_the_one_before_it_used(how, tmp_path):
    said: list[str] = []
    checkpoints = saved(tmp_path, said)
    path = sorted(tmp_path.iterdir())[1]
    path.write_bytes(SPOILT[how](path.read_bytes()))
    found = checkpoints.load(chunk(0).state, [5] * 3)
    assert len(found) == 1
    assert len(said) == 1
    assert str(path) in said[0]
    assert said[0].isprintable()
    assert said[0].endswith("; the run goes on from the checkpoint before it")


@pytest.mark.parametrize("older", ["of another number", "of no number yet"])
def test_draws_that_mean_something_else_are_refused_and_never_used(older, tmp_path, monkeypatch):
    said: list[str] = []
    with monkeypatch.context() as before:
        before.setattr(checkpoint, "FORMAT", checkpoint.FORMAT - 1)
        checkpoints = saved(tmp_path, said)
    if older == "of no number yet":
        for path in tmp_path.iterdir():
            arrays = read_arrays(path)
            del arrays["format"]
            write_arrays(arrays, path)
    with pytest.raises(BadInput, match=r"mean something else; leave out --resume"):
        checkpoints.identity_found()
    assert checkpoints.load(chunk(0).state, [5] * 3) == []
    assert "mean something else; the run goes on from the checkpoint before it" in said[0]


@pytest.mark.parametrize("how", SPOILT)
def test_a_spoilt_first_checkpoint_is_refused_in_one_line(how, tmp_path):
    checkpoints = saved(tmp_path)
    path = sorted(tmp_path.iterdir())[0]
    path.write_bytes(SPOILT[how](path.read_bytes()))
    with pytest.raises(BadInput, match="no checkpoint that can be read") as caught:
        checkpoints.identity_found()
    assert str(caught.value).isprintable()


def test_what_another_run_put_among_the_checkpoints_is_not_used(tmp_path):
    checkpoints = saved(tmp_path)
    Checkpoints(tmp_path, IDENTITY | {"seed": 2}).save(1, chunk(1))
    assert len(checkpoints.load(chunk(0).state, [5] * 3)) == 1


@pytest.mark.parametrize("lengths", [[4, 5, 5], [6, 5, 5]])
def test_a_checkpoint_of_another_shape_is_not_used(lengths, tmp_path):
    assert saved(tmp_path).load(chunk(0).state, lengths) == []
    other = State(np.zeros(3), {"k": np.zeros((2, 3))})
    assert saved(tmp_path).load(other, [5] * 3) == []


def test_a_disk_that_fills_is_told_once_and_nothing_half_written_is_left(tmp_path, monkeypatch):
    def full(self: Path, target: Path) -> Path:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    said: list[str] = []
    with monkeypatch.context() as disk:
        disk.setattr(Path, "replace", full)
        checkpoints = saved(tmp_path / "c", said)
    assert len(said) == 1
    assert os.strerror(errno.ENOSPC) in said[0]
    assert "goes on" in said[0]
    checkpoints.save(3, chunk(3))  # a gap must not be followed by more
    assert not (tmp_path / "c").exists()


def test_no_pickle_is_written_or_read(tmp_path):
    objects = np.array([object()])
    with pytest.raises(TypeError, match="pickle"):
        write_arrays({"k": objects}, tmp_path / "k.npz")
    assert not list(tmp_path.iterdir())
    np.savez(tmp_path / "pickled.npz", k=np.array([{"a": 1}]))
    with pytest.raises(BadInput, match="allow_pickle"):
        read_arrays(tmp_path / "pickled.npz")


def test_a_run_goes_on_from_any_of_its_checkpoints_to_the_same_bits(tmp_path, monkeypatch):
    settings = replace(SETTINGS, checkpoints=Checkpoints(tmp_path / "whole", IDENTITY))
    whole = sample(model, DATA, settings, STARTS)
    files = sorted((tmp_path / "whole").iterdir())
    assert len(files) == 4  # 130 and 110 iterations, in chunks of 100
    for kept in (1, 2, 3, 4):  # in warmup, at the seam, among the draws, at their end
        folder = tmp_path / str(kept)
        folder.mkdir()
        for file in files[:kept]:
            shutil.copy(file, folder)
        with monkeypatch.context() as watched:
            watched.setattr(sampling.Chains, "begin", lambda *_: pytest.fail("began anew"))
            again = replace(settings, checkpoints=Checkpoints(folder, IDENTITY))
            assert_same(sample(model, DATA, again, STARTS), whole)
        for file in files:
            assert (folder / file.name).read_bytes() == file.read_bytes()


def test_a_run_whose_disk_fills_gives_the_same_bits(tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path))

    said: list[str] = []
    monkeypatch.setattr(checkpoint, "write_arrays", full)
    settings = replace(SETTINGS, checkpoints=Checkpoints(tmp_path / "c", IDENTITY, said.append))
    assert_same(sample(model, DATA, settings, STARTS), sample(model, DATA, SETTINGS, STARTS))
    assert len(said) == 1
