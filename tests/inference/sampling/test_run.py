"""Divergences: the run is repeated once with shorter steps, unless the user chose them; the better one is kept."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpyro.infer.hmc import HMCState

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling import run as module
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.chunks import Chunk
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import (
    LONGEST,
    REPEAT_ACCEPTANCE,
    RUNS,
    Begun,
    SamplerRun,
    SamplerSettings,
    kept_acceptance,
    run_until_sound,
    runs_to_json,
    sampler_runs,
)

SETTINGS = SamplerSettings(chains=2, warmup=10, draws=120, seed=3)


def state_at(x: float) -> HMCState:
    """Return what a run knows of a sampler's state: where the chains are."""
    nothing: list[Any] = [None] * len(HMCState._fields)
    return HMCState(*nothing)._replace(z={"x": np.full((2, 1), x)})


class MadeUp(Chains):
    """Chains that move nothing: each draw is the acceptance, and so many transitions diverge as `divergent` says."""

    def __init__(self, divergent: Mapping[float, int], acceptance: float, advanced: list[float]) -> None:
        self.divergent, self.acceptance, self.advanced = divergent, acceptance, advanced
        self.shapes: Any = state_at(0.0)
        self.states: list[Any] = []
        self.constrained = 0

    def at_acceptance(self, acceptance: float) -> "MadeUp":
        other = MadeUp(self.divergent, acceptance, self.advanced)
        other.states = self.states
        return other

    def begin(self, seed: int) -> Any:
        assert seed == SETTINGS.seed
        return self.shapes

    def advance(self, state: Any, iterations: int) -> Chunk:
        self.advanced.append(self.acceptance)
        self.states.append(state)
        diverging = np.zeros((2, iterations), bool)
        if iterations == 20:  # the last of the draws
            diverging.ravel()[: self.divergent[self.acceptance]] = True
        return Chunk(state, {"x": np.full((2, iterations, 1), self.acceptance)}, {"diverging": diverging})

    def constrain(self, unconstrained: Mapping[str, np.ndarray], seed: Sequence[int]) -> dict[str, np.ndarray]:
        self.constrained += next(iter(unconstrained.values())).shape[1]
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


@pytest.mark.parametrize(("begun", "left"), [(300, 300), (500, 100), (700, 100)])
def test_chains_that_have_begun_do_what_is_left_of_their_warmup(begun, left):
    """At least one chunk of it, for what they go on with is new to them."""
    chains, settings, stages = made(0), replace(SETTINGS, warmup=600), []
    settings = replace(settings, on_stage=lambda name, count: stages.append((name, count)))
    run_until_sound(chains, settings, begun=Begun(state_at(5.0), begun))
    assert stages[0] == ("warm-up", left)
    assert chains.states[0].z["x"].tolist() == [[5.0], [5.0]]


def test_a_run_repeated_begins_where_the_first_one_began():
    chains = made(3)
    run_until_sound(chains, SETTINGS, begun=Begun(state_at(5.0), 0))
    assert chains.advanced == [0.65, 0.65, 0.65, *[REPEAT_ACCEPTANCE] * 3]
    assert [state.z["x"].tolist() for state in chains.states] == 6 * [[[5.0], [5.0]]]


@pytest.mark.parametrize("target", [0.49, 0.995, float("nan")])
def test_an_acceptance_out_of_range_is_refused(target):
    with pytest.raises(BadInput, match=r"target_accept is .*; give 0.5 to 0.99"):
        SamplerSettings(target_accept=target)


def test_runs_are_read_from_a_posterior_as_they_were_written():
    runs, tree = (SamplerRun(0.65, 3, False), SamplerRun(0.99, 0, True)), xr.DataTree()
    assert (sampler_runs(tree), kept_acceptance(tree)) == ((), None)
    tree.attrs[RUNS] = runs_to_json(runs)
    assert (sampler_runs(tree), kept_acceptance(tree)) == (runs, 0.99)


class Correlated(MadeUp):
    """Chains of an autoregressive quantity k, whose draws differ by rho; the last of each part's draws may diverge."""

    def __init__(self, rho: float, divergent: int = 0) -> None:
        super().__init__({0.65: divergent}, 0.65, [])
        self.rho, self.random, self.last = rho, np.random.default_rng(5), np.zeros((2, 1))

    def advance(self, state: Any, iterations: int) -> Chunk:
        chunk = super().advance(state, iterations)
        values = np.empty((2, iterations, 1))
        for i in range(iterations):
            self.last = self.rho * self.last + self.random.standard_normal((2, 1))
            values[:, i] = self.last
        return chunk._replace(unconstrained={"k": values})


LONGER = replace(SETTINGS, draws=520, longest=4)


@pytest.mark.parametrize(("rho", "every"), [(0.0, 1), (0.95, 4)])
def test_a_run_goes_on_where_an_effective_sample_size_falls_short(rho, every):
    """520 draws a chain of rho = 0.95 are worth 13, and 100 are wanted: it goes on to its end."""
    said: list[str] = []
    chains = Correlated(rho)
    draws, runs = run_until_sound(chains, replace(LONGER, on_note=said.append))
    assert (draws.every, runs[0].every) == (every, every)
    assert draws.sites["k"].shape == (2, 520, 1)
    assert len(chains.advanced) == 1 + every * 6
    assert len(said) == every - 1
    # What is not kept is computed of no draw, each time that it is judged.
    assert chains.constrained == every * 520
    assert all(note.startswith("R-hat or ESS falls short after ") for note in said)
    assert draws.statistics["diverging"].shape == (2, 520)


def test_kept_draws_lie_evenly_among_all_and_diverge_where_any_did():
    whole, _ = run_until_sound(Correlated(0.95), replace(LONGER, draws=2080, longest=1))
    spaced, _ = run_until_sound(Correlated(0.95, divergent=1), replace(LONGER, target_accept=0.65))
    np.testing.assert_array_equal(spaced.sites["k"], whole.sites["k"][:, 3::4])
    # One transition of each part's last chunk diverged: the first of its 20, in one chain.
    assert np.flatnonzero(spaced.statistics["diverging"][0]).tolist() == [125, 255, 385, 515]
    assert spaced.divergences == 4


def test_a_run_asked_for_by_its_draws_is_no_longer():
    draws, runs = run_until_sound(Correlated(0.95), replace(LONGER, longest=1))
    assert (draws.every, runs[0].every) == (1, 1)


def test_a_run_that_is_repeated_or_of_no_use_does_not_go_on_first():
    draws, _ = run_until_sound(Correlated(0.95), LONGER, usable=lambda _: False)
    assert draws.every == 1
    chains = Correlated(0.95, divergent=1)
    chains.at_acceptance = lambda _: Correlated(0.0)  # pyright: ignore[reportAttributeAccessIssue]
    _, runs = run_until_sound(chains, LONGER)
    assert [(one.divergences, one.every) for one in runs] == [(1, 1), (0, 1)]


@pytest.mark.parametrize("lost", [24, 20, 7, 3])
def test_a_longer_run_goes_on_from_its_checkpoints(lost, tmp_path):
    """Chains of made-up numbers go on from nowhere: only what is loaded is the same, and how long the run is."""
    settings = replace(LONGER, checkpoints=Checkpoints(tmp_path / "c", {"seed": 3}))
    whole, runs = run_until_sound(Correlated(0.95), settings)
    chunks = sorted((tmp_path / "c").iterdir())
    assert len(chunks) == 25
    removed(chunks[lost:])
    chains = Correlated(0.95)
    resumed, again = run_until_sound(chains, settings)
    assert len(chains.advanced) == 25 - lost
    assert [one.every for one in again] == [one.every for one in runs]
    # What was lost is made up anew by chains that begin afresh: all of the chunks before it are as they were.
    first = min((lost - 1) * 100, 520) // 4
    np.testing.assert_array_equal(resumed.sites["k"][:, :first], whole.sites["k"][:, :first])


def test_many_records_have_fewer_draws_unless_their_number_was_asked_for():
    default, asked = SamplerSettings(longest=LONGEST), SamplerSettings(draws=1500)
    assert default.for_records(99) is default
    assert asked.for_records(100) is asked
    many = default.for_records(100)
    assert many.draws < default.draws
    # As many as ever where they are needed.
    assert many.draws * many.longest == default.draws * default.longest
