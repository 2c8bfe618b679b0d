"""`fit --device`: what is asked for is what JAX is told, and a GPU that is not there is refused before any work."""

import pytest
from helpers.command_line import assert_refused, here, small, written

from bayes_tyre.cli.commands import fit as command


@pytest.mark.parametrize(
    ("device", "found", "fits"), [("gpu", True, True), ("gpu", False, False), ("cpu", False, True), (None, False, True)]
)
def test_a_gpu_is_refused_where_there_is_none(device, found, fits, tmp_path, monkeypatch):
    told, fitted = [], []
    monkeypatch.setattr(command, "prepare_jax", lambda chains, asked: told.append(asked))
    monkeypatch.setattr(command, "finds_gpu", lambda: found)
    monkeypatch.setattr(command.sampled, "fitted", lambda *_, out, **__: fitted.append(out))
    asked = [] if device is None else ["--device", device]
    done = here("fit", written(small(), tmp_path / "records.csv"), "--out", tmp_path / "out", *asked, "--quiet")
    assert told == [device]
    assert fitted == [tmp_path / "out"] * fits
    if not fits:
        assert_refused(done.exit_code, done.stderr, "--device gpu", "JAX_PLATFORMS")
        assert not (tmp_path / "out").exists()
