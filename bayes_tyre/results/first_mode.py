"""The first mode of a belt as `motion --law rigid_ring` found it, for a flexible ring of the same tyre."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.datatree import priors_of, tree_cases
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.plain_text import listed, quoted

#: The mode is found where its posterior is so many times narrower than its prior, both of the logarithm.
NARROWER = 3.0
_NEEDED = ("belt_frequency", "sidewall_ratio")
_PRIOR_DRAWS = 4000


class FirstMode(NamedTuple):
    """A natural frequency, Hz, and its standard deviation, Hz."""

    frequency_Hz: float
    sd_Hz: float


def first_mode(tree: xr.DataTree, configuration: str | None = None) -> FirstMode:
    """Return the natural frequency of mode 1 of a configuration's belt, the road taken away: that of a flexible ring.

    It is that of the means of the configuration's groups (their geometric mean over the directions), whose draws are
    taken for normal.

    Parameters
    ----------
    tree:
        Posterior of `motion --law rigid_ring`.
    configuration:
        Whose belt; None: of the only one.

    Raises
    ------
    BadInput
        If the posterior is of another law, has no such configuration or several, or does not determine the mode.
    """
    posterior = tree["posterior"].to_dataset()
    if any(f"{name}_group" not in posterior for name in _NEEDED):
        raise BadInput("is no posterior of a rigid ring; name a folder that motion --law rigid_ring wrote")
    logs = np.log(_frequency(*(posterior[f"{name}_group"].transpose(..., "group").to_numpy() for name in _NEEDED)))
    of_label = {f"{case[0] or ''} {case[1] or ''}".strip(): case.configuration or "" for case in tree_cases(posterior)}
    of_group = [of_label[str(label)] for label in posterior["group"].to_numpy()]
    chosen = _chosen(sorted(set(of_group)), configuration)
    log = logs[..., [name == chosen for name in of_group]].mean(axis=-1)
    if _prior_sd(tree) < NARROWER * (sd := float(log.std())):
        raise BadInput(
            f"its motions do not determine the first mode: known to {100 * sd:.2g} %, which is less than {NARROWER:g} "
            "times narrower than the prior; leave --motion out"
        )
    frequency = np.exp(log)
    return FirstMode(float(frequency.mean()), float(frequency.std()))


def _chosen(there: list[str], configuration: str | None) -> str:
    if configuration is None and len(there) == 1:
        return there[0]
    if configuration not in there:
        what = "holds several configurations" if configuration is None else f"has no {quoted(configuration)}"
        raise BadInput(f"{what}; give --configuration, one of {listed(there)}")
    return configuration


def _frequency(belt_frequency: np.ndarray, sidewall_ratio: np.ndarray) -> np.ndarray:
    of_one = jnp.vectorize(lambda frequency, ratio: RigidRing(1.0, 0.0, frequency, 0.0, ratio).first_mode)
    return np.asarray(of_one(belt_frequency, sidewall_ratio))


def _prior_sd(tree: xr.DataTree) -> float:
    """Return the standard deviation of the logarithm of the mode before any motion."""
    priors, rng = priors_of(tree), np.random.default_rng(0)
    draws = (priors[f"{name}_group"].scipy().rvs(_PRIOR_DRAWS, random_state=rng) for name in _NEEDED)
    return float(np.log(_frequency(*draws)).std())
