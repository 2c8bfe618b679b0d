"""NUTS over the hierarchical models: starts, chains side by side, draws and statistics as plain arrays."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpyro.handlers import seed, substitute, trace
from numpyro.infer import MCMC, NUTS
from numpyro.infer.initialization import init_to_uniform

from bayes_tyre.errors import BadInput

#: Scales near zero make narrow necks; NumPyro's 0.8 left a few divergences in them.
TARGET_ACCEPTANCE = 0.9
#: Standard deviation of the starts' logarithm about the values given.
START_SPREAD = 0.2
#: Sites with at most this many unknowns share one dense block of the mass matrix.
DENSE_UP_TO = 16

_STATISTICS = {"diverging": "diverging", "energy": "energy", "num_steps": "n_steps", "accept_prob": "acceptance_rate"}


@dataclass(frozen=True)
class SamplerSettings:
    """How much to sample.

    Attributes
    ----------
    chains, warmup, draws:
        Number of chains; iterations of each to adapt, and to keep.
    seed:
        The same seed, data and settings give the same draws.
    progress:
        Whether to draw a progress bar on stderr.

    Raises
    ------
    BadInput
        For counts too small to judge a chain by.
    """

    chains: int = 4
    warmup: int = 600
    draws: int = 1500
    seed: int = 0
    progress: bool = False

    def __post_init__(self) -> None:
        for name, least in (("chains", 1), ("warmup", 1), ("draws", 4)):
            if getattr(self, name) < least:
                raise BadInput(f"{name} is {getattr(self, name)}; give at least {least}")


class Draws(NamedTuple):
    """Draws by site and sampler statistics by ArviZ's name; shapes (chains, draws, ...)."""

    sites: dict[str, np.ndarray]
    statistics: dict[str, np.ndarray]


def _start_near(values: Mapping[str, Any], site: dict | None = None) -> Any:
    """Start the named sites near their values and the others around zero, spread from chain to chain."""
    if site is None:
        return partial(_start_near, values)
    if site["type"] == "sample" and not site["is_observed"] and site["name"] in values:
        value = jnp.asarray(values[site["name"]])
        spread = jax.random.normal(site["kwargs"]["rng_key"], site["fn"].shape())
        return value * jnp.exp(START_SPREAD * spread)
    return init_to_uniform(site, radius=0.5)  # pyright: ignore[reportArgumentType]  (says int, takes float)


def _population_sites(model: Callable[..., None], arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the sites of few unknowns: the populations, correlated and worth a dense mass matrix together."""
    first = substitute(seed(model, 0), substitute_fn=init_to_uniform)
    sites = trace(first).get_trace(**arguments).values()
    latent = [site for site in sites if site["type"] == "sample" and not site["is_observed"]]
    return tuple(str(site["name"]) for site in latent if jnp.size(site["value"]) <= DENSE_UP_TO)


def sample(
    model: Callable[..., None],
    arguments: Mapping[str, Any],
    settings: SamplerSettings,
    starts: Mapping[str, Any] | None = None,
) -> Draws:
    """Return NUTS draws of a NumPyro model.

    Parameters
    ----------
    model, arguments:
        The model, and its keyword arguments.
    settings:
        How much to sample.
    starts:
        Positive values by site near which to start.

    Chains run in parallel where the host has a device for each (`bayes_tyre.runtime.prepare_jax`), otherwise
    one after another: vectorised chains wait for the longest tree and were five times slower.
    """
    mcmc = MCMC(
        NUTS(
            model,
            init_strategy=_start_near(starts or {}),
            target_accept_prob=TARGET_ACCEPTANCE,
            dense_mass=[_population_sites(model, arguments)],  # pyright: ignore[reportArgumentType]
        ),
        num_warmup=settings.warmup,
        num_samples=settings.draws,
        num_chains=settings.chains,
        chain_method="parallel" if jax.local_device_count() >= settings.chains else "sequential",
        progress_bar=settings.progress,
    )
    mcmc.run(jax.random.key(settings.seed), extra_fields=tuple(_STATISTICS), **arguments)
    extra = mcmc.get_extra_fields(group_by_chain=True)
    return Draws(
        sites={name: np.asarray(value) for name, value in mcmc.get_samples(group_by_chain=True).items()},
        statistics={ours: np.asarray(extra[theirs]) for theirs, ours in _STATISTICS.items()},
    )
