"""A run of NUTS over a hierarchical model: from settings to draws and statistics as plain arrays, saved on the way."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.nuts import CHUNK, TARGET_ACCEPTANCE, Chains, leave_resonance


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
        Called with the number of iterations of a chain just done, warmup included.
    checkpoints:
        Where the run is saved as it goes on, and continued from where it was saved; None: nowhere.

    Raises
    ------
    BadInput
        For counts too small to judge a chain by.
    """

    chains: int = 4
    warmup: int = 600
    draws: int = 1500
    seed: int = 0
    on_progress: Callable[[int], None] = field(default=lambda _: None, compare=False, repr=False)
    checkpoints: Checkpoints | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name, least in (("chains", 1), ("warmup", 1), ("draws", 4)):
            if getattr(self, name) < least:
                raise BadInput(f"{name} is {getattr(self, name)}; give at least {least}")


class Draws(NamedTuple):
    """Draws by site and sampler statistics by ArviZ's name; shapes (chains, draws, ...)."""

    sites: dict[str, np.ndarray]
    statistics: dict[str, np.ndarray]


def sample(
    model: Callable[..., None],
    arguments: Mapping[str, Any],
    settings: SamplerSettings,
    starts: Mapping[str, Any] | None = None,
    acceptance: float = TARGET_ACCEPTANCE,
) -> Draws:
    """Return NUTS draws of a NumPyro model.

    Parameters
    ----------
    model, arguments:
        The model, and its keyword arguments; JAX arrays among them are traced, NumPy arrays are constants.
    settings:
        How much to sample.
    starts:
        Positive values near which the sites of the populations start; they share a dense block of the mass matrix.
    acceptance:
        Mean acceptance that steps are adapted to: the higher, the shorter they are.
    """
    chains = Chains(model, arguments, settings.chains, settings.warmup, starts or {}, acceptance)
    return run(chains, settings)


def run(chains: Chains, settings: SamplerSettings) -> Draws:
    """Return the draws of chains made for these settings.

    Chains run in parallel where the host has a device for each (`bayes_tyre.runtime.prepare_jax`). A run that goes on
    from a checkpoint gives the draws, to the bit, of one left alone.
    """
    warmup, draws = _lengths(settings.warmup), _lengths(settings.draws)
    lengths, saved = warmup + draws, settings.checkpoints
    done = saved.load(chains.shapes, lengths) if saved else []
    settings.on_progress(sum(lengths[: len(done)]))
    state = done[-1].state if done else chains.begin(settings.seed)
    for number, length in enumerate(lengths[len(done) :], len(done)):
        if number == len(warmup):
            state = leave_resonance(state)
        chunk = chains.advance(state, length)
        state = chunk.state
        if number < len(warmup):
            chunk = chunk._replace(unconstrained={}, statistics={})
        done.append(chunk)
        if saved:
            saved.save(number, chunk)
        settings.on_progress(length)
    kept = done[len(warmup) :]
    sites = _joined([chains.constrain(chunk.unconstrained) for chunk in kept])
    return Draws(sites, _joined([chunk.statistics for chunk in kept]))


def _lengths(iterations: int) -> list[int]:
    """Return the lengths of the chunks that iterations are cut into."""
    return [min(CHUNK, iterations - start) for start in range(0, iterations, CHUNK)]


def _joined(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}
