"""A run of NUTS over a hierarchical model: from settings to draws and statistics as plain arrays, saved on the way."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpyro.infer.hmc import HMCState

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.chunks import CHUNK, Chunk, joined
from bayes_tyre.inference.sampling.datatree import PROBABILITIES, QUANTITIES
from bayes_tyre.inference.sampling.effective_sizes import falls_short
from bayes_tyre.inference.sampling.nuts import TARGET_ACCEPTANCE, Chains
from bayes_tyre.inference.sampling.resonance import leave_resonance

#: Target acceptances that may be asked for: below, trajectories diverge that need not; above, steps become so short
#: that trees reach their limit.
ACCEPTANCE_LEAST, ACCEPTANCE_MOST = 0.5, 0.99
#: For the one repeat of a run with divergences: it has to do. Of the centred eight schools (3 to 8 runs of 2
#: chains, 1000 draws) 0.65 left 30 divergences a run, 0.8 seven, 0.95 seven, 0.98 one, 0.99 less than one, for five
#: times the gradients of 0.65.
REPEAT_ACCEPTANCE = 0.99
#: Runs of `run_until_sound`, at most.
RUNS_AT_MOST = 2
#: How many times as many draws a run takes at most, unless their number was asked for.
LONGEST = 4
#: From so many records on, draws of each chain, and how many times as many a run takes at most. Their number sets the
#: time and the memory of all that follows the chains, and what so many records share mixes well. Fewer would not do:
#: of a hundred thousand quantities the worst R-hat of independent draws is above 1.01 with 250 of each chain.
_MANY_RECORDS, _OF_MANY_RECORDS = 100, (750, 8)
#: Attribute of a posterior's tree with the runs of the sampler behind it, as JSON.
RUNS = "sampler_runs"


@dataclass(frozen=True)
class SamplerSettings:
    """How much to sample.

    Attributes
    ----------
    chains, warmup, draws:
        Number of chains; iterations of each to adapt, and to keep.
    seed:
        The same seed, data and settings give the same draws.
    on_progress:
        Called with the number of iterations of a chain just done in a stage.
    checkpoints:
        Where the run is saved as it goes on, and continued from where it was saved; None: nowhere.
    target_accept:
        Mean acceptance that steps are adapted to: the higher, the shorter they are. None: the model's own, and a fit
        with divergences is repeated once at `REPEAT_ACCEPTANCE`.
    longest:
        Where R-hat or an effective sample size falls short, a run goes on to at most so many times `draws`; `draws` of
        them are kept, evenly spaced.
    on_note:
        Called with a line on what the run does by itself.
    on_stage:
        Called as a stage of the run begins, with its name and its iterations of a chain; None: there are none to count.

    Raises
    ------
    BadInput
        For counts too small to judge a chain by, a negative seed, and an acceptance out of range.
    """

    chains: int = 4
    warmup: int = 600
    draws: int = 1500
    seed: int = 0
    on_progress: Callable[[int], None] = field(default=lambda _: None, compare=False, repr=False)
    checkpoints: Checkpoints | None = field(default=None, compare=False, repr=False)
    target_accept: float | None = None
    on_note: Callable[[str], None] = field(default=lambda _: None, compare=False, repr=False)
    on_stage: Callable[[str, int | None], None] = field(default=lambda *_: None, compare=False, repr=False)
    longest: int = 1

    def __post_init__(self) -> None:
        for name, least in (("chains", 1), ("warmup", 1), ("draws", 4), ("longest", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise BadInput(f"{name} is {getattr(self, name)}; give at least {least}")
        if self.target_accept is not None and not ACCEPTANCE_LEAST <= self.target_accept <= ACCEPTANCE_MOST:
            raise BadInput(
                f"target_accept is {self.target_accept:g}; give {ACCEPTANCE_LEAST:g} to {ACCEPTANCE_MOST:g}, such as "
                f"{REPEAT_ACCEPTANCE:g} against divergences"
            )

    def for_records(self, count: int) -> "SamplerSettings":
        """Return the settings for so many records: of many fewer draws, unless their number was asked for."""
        if self.longest == 1 or count < _MANY_RECORDS:
            return self
        draws, longest = _OF_MANY_RECORDS
        return replace(self, draws=draws, longest=longest)


class Draws(NamedTuple):
    """Draws by site and sampler statistics by ArviZ's name; shapes (chains, draws, ...).

    Of every `every` iterations one is a draw; it counts as diverging where any of them did. `unconstrained` is what the
    sampler sees of them (`bayes_tyre.inference.sampling.parameter_vector.Blocks`).
    """

    sites: dict[str, np.ndarray]
    statistics: dict[str, np.ndarray]
    unconstrained: dict[str, np.ndarray]
    every: int = 1

    @property
    def divergences(self) -> int:
        """How many transitions diverged."""
        return int(self.statistics["diverging"].sum())


class SamplerRun(NamedTuple):
    """A run of the sampler.

    Attributes
    ----------
    target_accept, divergences:
        The acceptance it adapted to, and its divergent transitions.
    kept:
        Whether its draws are the posterior.
    sampler:
        ``joint``: records were sampled beside what they share; ``collapsed``: they were integrated out.
    every:
        Of how many iterations one is a draw.
    """

    target_accept: float
    divergences: int
    kept: bool
    sampler: str = "joint"
    every: int = 1


def runs_to_json(runs: Sequence[SamplerRun]) -> str:
    """Return runs of the sampler as a posterior's tree carries them in `RUNS`."""
    return json.dumps([one._asdict() for one in runs])


def sampler_runs(tree: xr.DataTree) -> tuple[SamplerRun, ...]:
    """Return the runs of the sampler behind a posterior, in their order; none where its tree does not say."""
    return tuple(SamplerRun(**one) for one in json.loads(tree.attrs.get(RUNS, "[]")))


def kept_acceptance(tree: xr.DataTree) -> float | None:
    """Return the acceptance that the draws of a posterior were adapted to; None where its tree does not say."""
    return next((one.target_accept for one in sampler_runs(tree) if one.kept), None)


def sample(
    model: Callable[..., None],
    arguments: Mapping[str, Any],
    settings: SamplerSettings,
    starts: Mapping[str, Any] | None = None,
    acceptance: float = TARGET_ACCEPTANCE,
) -> Draws:
    """Return NUTS draws of a NumPyro model, from one run.

    Parameters
    ----------
    model, arguments:
        The model, and its keyword arguments; JAX arrays among them are traced, NumPy arrays are constants.
    settings:
        How much to sample.
    starts:
        Unconstrained values near which hyperparameters start; these share a dense block of the mass matrix.
    acceptance:
        The model's own, for settings that name none.
    """
    return run(make_chains(model, arguments, settings, starts or {}, acceptance), settings)


def make_chains(
    model: Callable[..., None],
    arguments: Mapping[str, Any],
    settings: SamplerSettings,
    starts: Mapping[str, Any],
    acceptance: float = TARGET_ACCEPTANCE,
) -> Chains:
    """Return the chains of a model for these settings; arguments as `sample` has them."""
    asked = acceptance if settings.target_accept is None else settings.target_accept
    settings.on_stage("compiling", None)
    return Chains(model, arguments, settings.chains, settings.warmup, starts, asked)


class Begun(NamedTuple):
    """Chains that have done some iterations of their warm-up: the state that these left, and their number."""

    state: HMCState
    iterations: int


def run_until_sound(
    chains: Chains,
    settings: SamplerSettings,
    usable: Callable[[Draws], bool] = lambda _: True,
    begun: Begun | None = None,
) -> tuple[Draws, tuple[SamplerRun, ...]]:
    """Return the draws of chains, or of a second run with shorter steps where transitions diverged; and the runs made.

    A divergence says that steps were too long somewhere, and only shorter ones reach it. The second run is the one that
    `target_accept` of `REPEAT_ACCEPTANCE` would be, with the same seed, so that either can be had by itself; of chains
    that have `begun` both go on from there. An acceptance that the user asked for is left alone. Draws that are not
    `usable` are not repeated, nor kept.
    """
    repeatable = settings.target_accept is None
    first = run(chains, settings, lambda draws: usable(draws) and not (repeatable and draws.divergences), begun)
    if not usable(first):
        return first, (SamplerRun(chains.acceptance, first.divergences, False, every=first.every),)
    if not (repeatable and first.divergences):
        return first, (SamplerRun(chains.acceptance, first.divergences, True, every=first.every),)
    settings.on_note(
        f"{first.divergences} divergent transitions at target acceptance {chains.acceptance:g}: sampled once more at "
        f"{REPEAT_ACCEPTANCE:g}"
    )
    second = run(chains.at_acceptance(REPEAT_ACCEPTANCE), after_runs(settings, 1), begun=begun)
    better = second.divergences <= first.divergences
    runs = (
        SamplerRun(chains.acceptance, first.divergences, not better, every=first.every),
        SamplerRun(REPEAT_ACCEPTANCE, second.divergences, better, every=second.every),
    )
    return (second if better else first), runs


def after_runs(settings: SamplerSettings, count: int) -> SamplerSettings:
    """Return the settings of a run after so many of these, whose checkpoints follow: those before are loaded whole."""
    saved = settings.checkpoints
    if saved is None:
        return settings
    chunks = len(_lengths(settings.warmup)) + settings.longest * len(_lengths(settings.draws))
    return replace(settings, checkpoints=replace(saved, first=saved.first + count * chunks))


def run(
    chains: Chains,
    settings: SamplerSettings,
    worthwhile: Callable[[Draws], bool] = lambda _: True,
    begun: Begun | None = None,
) -> Draws:
    """Return the draws of chains made for these settings, of which some of the warm-up may have `begun`.

    Where these allow it, a run whose R-hat or effective sample sizes fall short goes on, while that is `worthwhile`.
    Chains run in parallel where the host has a device for each (`bayes_tyre.runtime.prepare_jax`). A run that goes on
    from a checkpoint gives the draws, to the bit, of one left alone.
    """
    if begun is not None:
        settings = replace(settings, warmup=max(settings.warmup - begun.iterations, min(settings.warmup, CHUNK)))
    warmup, draws, saved = _lengths(settings.warmup), _lengths(settings.draws), settings.checkpoints
    done = saved.load(chains.shapes, warmup + settings.longest * draws) if saved else []
    every = 0
    while True:
        every += 1
        _advance(chains, settings, done, every, begun)
        settings.on_stage("quantities of each draw", None)
        kept = _evenly_spaced(chains, settings, done[len(warmup) : len(warmup) + every * len(draws)], every)
        if every == settings.longest or not worthwhile(kept) or not _falls_short(kept):
            return kept
        settings.on_note(
            f"R-hat or ESS falls short after {settings.draws * every} draws of each chain: it draws "
            f"{settings.draws} more, and keeps {settings.draws} of all"
        )


def _advance(chains: Chains, settings: SamplerSettings, done: list[Chunk], every: int, begun: Begun | None) -> None:
    """Add the missing chunks of a run, up to `every` times its draws."""
    warmup, draws = _lengths(settings.warmup), _lengths(settings.draws)
    lengths, resumed = warmup + every * draws, len(done)
    state = done[-1].state if done else _first_state(chains, settings.seed, begun)
    for number, length in enumerate(lengths[resumed:], resumed):
        if number in (resumed, len(warmup)):
            first = len(warmup) + (every - 1) * len(draws)
            name, first, of_stage = ("draws", first, draws) if number >= len(warmup) else ("warm-up", 0, warmup)
            settings.on_stage(name, sum(of_stage))
            settings.on_progress(sum(lengths[first:number]))
        if number == len(warmup):
            state = leave_resonance(state)
        chunk = chains.advance(state, length)
        state = chunk.state
        if number < len(warmup):
            chunk = chunk._replace(unconstrained={}, statistics={})
        done.append(chunk)
        if settings.checkpoints:
            settings.checkpoints.save(number, chunk)
        settings.on_progress(length)


def _first_state(chains: Chains, seed: int, begun: Begun | None) -> HMCState:
    """Return the state that chains go on from: where they have begun, or what begins them."""
    return chains.begin(seed) if begun is None else begun.state


def _evenly_spaced(chains: Chains, settings: SamplerSettings, chunks: Sequence[Chunk], every: int) -> Draws:
    """Return one of every so many draws of these chunks: what is not kept is not computed from them either."""
    last, count = slice(every - 1, None, every), settings.draws * every
    statistics = joined((chunk.statistics for chunk in chunks), count)
    diverging = statistics["diverging"]
    of_each = diverging.reshape(len(diverging), -1, every).any(axis=2)
    unconstrained = {
        name: np.ascontiguousarray(z[:, last])
        for name, z in joined((chunk.unconstrained for chunk in chunks), count).items()
    }
    starts = range(0, settings.draws, CHUNK)
    first = (every - 1) * len(starts)  # draws that were judged before are drawn anew
    constrained = (
        chains.constrain({name: z[:, i : i + CHUNK] for name, z in unconstrained.items()}, (settings.seed, number))
        for number, i in enumerate(starts, first)
    )
    kept = {name: values[:, last] for name, values in statistics.items()} | {"diverging": of_each}
    return Draws(joined(constrained, settings.draws), kept, unconstrained, every)


def _falls_short(draws: Draws) -> bool:
    """Return whether the verdict would ask for more draws."""
    judged = [name for name in QUANTITIES if name in draws.sites and name not in PROBABILITIES]
    return any(falls_short(draws.sites[name].reshape(*draws.sites[name].shape[:2], -1)) for name in judged)


def _lengths(iterations: int) -> list[int]:
    """Return the lengths of the chunks that iterations are cut into."""
    return [min(CHUNK, iterations - start) for start in range(0, iterations, CHUNK)]
