"""Divergences: the run is repeated once with shorter steps, unless the user chose them; the better one is kept."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling import run as module
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.nuts import Chains, Chunk
from bayes_tyre.inference.sampling.run import (
    REPEAT_ACCEPTANCE,
    RUNS,
    SamplerRun,
    SamplerSettings,
    kept_acceptance,
    run_until_sound,
    runs_to_json,
    sampler_runs,
)

SETTINGS = SamplerSettings(chains=2, warmup=10, draws=120, seed=3)


class State(NamedTuple):
    """What a sampler's state is to a run."""

    z: dict[str, np.ndarray]


class MadeUp(Chains):
    """Chains that move nothing: each draw is the acceptance, and so many transitions diverge as `divergent` says."""

    def __init__(self, divergent: Mapping[float, int], acceptance: float, advanced: list[float]) -> None:
        self.divergent, self.acceptance, self.advanced = divergent, acceptance, advanced
        self.shapes: Any = State({"x": np.zeros((2, 1))})

    def at_acceptance(self, acceptance: float) -> "MadeUp":
        return MadeUp(self.divergent, acceptance, self.advanced)

    def begin(self, seed: int) -> Any:
        assert seed == SETTINGS.seed
        return self.shapes

    def advance(self, state: Any, iterations: int) -> Chunk:
        self.advanced.append(self.acceptance)
        diverging = np.zeros((2, iterations), bool)
        if iterations == 20:  # the last of the draws
            diverging.ravel()[: self.divergent[self.acceptance]] = True
        return Chunk(state, {"x": np.full((2, iterations, 1), self.acceptance)}, {"diverging": diverging})

    def constrain(self, unconstrained: Mapping[str, np.ndarray], seed: Sequence[int]) -> dict[str, np.ndarray]:
        return dict(unconstrained)


@pytest.fixture(autouse=True)
def no_resonance(monkeypatch) -> None:
    monkeypatch.setattr(module, "leave_resonance", lambda state: state)


def made(first: int, second: int = 0) -> MadeUp:
    return MadeUp({0.65: first, REPEAT_ACCEPTANCE: second}, 0.65, [])


def test_a_run_without_divergences_is_not_repeated():
    chains = made(0)
    draws, runs = run_until_sound(chains, SETTINGS)
    assert runs == (SamplerRun(0.65, 0, True),)
    assert set(chains.advanced) == {0.65}
    assert draws.sites["x"].shape == (2, 120, 1)


@pytest.mark.parametrize(("first", "second", "kept"), [(3, 0, 1), (3, 3, 1), (3, 1, 1), (3, 5, 0)])
def test_a_run_with_divergences_is_repeated_once_and_the_better_one_kept(first, second, kept):
    said: list[str] = []
    stages: list[list[object]] = []
    settings = replace(
        SETTINGS,
        on_note=said.append,
        on_stage=lambda name, total: stages.append([name, total, 0]),
        on_progress=lambda done: stages[-1].__setitem__(2, stages[-1][2] + done),
    )
    draws, runs = run_until_sound(made(first, second), settings)
    assert [(one.target_accept, one.divergences) for one in runs] == [(0.65, first), (REPEAT_ACCEPTANCE, second)]
    assert [one.kept for one in runs] == [kept == 0, kept == 1]
    assert (draws.sites["x"] == runs[kept].target_accept).all()
    assert said == ["3 divergent transitions at target acceptance 0.65: sampled once more at 0.99"]
    one_run = [
        ["warm-up", *2 * [SETTINGS.warmup]],
        ["draws", *2 * [SETTINGS.draws]],
        ["quantities of each draw", None, 0],
    ]
    assert stages == 2 * one_run


def test_an_acceptance_that_the_user_chose_is_left_alone():
    chains = made(3)
    _, runs = run_until_sound(chains, replace(SETTINGS, target_accept=0.65))
    assert runs == (SamplerRun(0.65, 3, True),)
    assert set(chains.advanced) == {0.65}


@pytest.mark.parametrize("lost", [5, 4, 3, 1, 0])
def test_a_repeat_goes_on_from_its_checkpoints(lost, tmp_path):
    settings = replace(SETTINGS, checkpoints=Checkpoints(tmp_path / "c", {"seed": 3}))
    whole, runs = run_until_sound(made(3), settings)
    chunks = sorted((tmp_path / "c").iterdir())
    assert len(chunks) == 6  # of each run: warmup, and two of draws
    removed(chunks[lost:])
    chains = made(3)
    resumed, again = run_until_sound(chains, settings)
    assert chains.advanced == [0.65, 0.65, 0.65, *[REPEAT_ACCEPTANCE] * 3][lost:]
    assert again == runs
    np.testing.assert_array_equal(resumed.sites["x"], whole.sites["x"])
    np.testing.assert_array_equal(resumed.statistics["diverging"], whole.statistics["diverging"])
    settings.checkpoints.clear()  # pyright: ignore[reportOptionalMemberAccess]
    assert not (tmp_path / "c").exists()


def removed(paths: list[Path]) -> None:
    for path in paths:
        path.unlink()


@pytest.mark.parametrize("target", [0.49, 0.995, float("nan")])
def test_an_acceptance_out_of_range_is_refused(target):
    with pytest.raises(BadInput, match=r"target_accept is .*; give 0.5 to 0.99"):
        SamplerSettings(target_accept=target)


def test_runs_are_read_from_a_posterior_as_they_were_written():
    runs, tree = (SamplerRun(0.65, 3, False), SamplerRun(0.99, 0, True)), xr.DataTree()
    assert (sampler_runs(tree), kept_acceptance(tree)) == ((), None)
    tree.attrs[RUNS] = runs_to_json(runs)
    assert (sampler_runs(tree), kept_acceptance(tree)) == (runs, 0.99)
