"""The terms of the linear predictors: group means, and the coordinates of each factor's effects, as arrays."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import Hyperparameters, effect_scales
from bayes_tyre.inference.model.priors import Priors


class Terms(NamedTuple):
    """The terms of all linear predictors, one parameter's after the other's.

    Attributes
    ----------
    design:
        Shape (parameters, cases, most terms): what each term adds to each case; 0 beyond a parameter's last term.
    lengths:
        Number of terms of each parameter.
    mean, fixed:
        Shape (terms,): prior mean of each term, and its standard deviation where that is not learnt: a group mean's.
    scales, which:
        Names of the standard deviations to be learnt, and which of them is that of each term, 0 or 1, shape
        (terms, scales).
    """

    design: Float[np.ndarray, "parameters cases most"]
    lengths: tuple[int, ...]
    mean: Float[np.ndarray, " terms"]
    fixed: Float[np.ndarray, " terms"]
    scales: tuple[str, ...]
    which: Float[np.ndarray, "terms scales"]

    def sd(self, hyperparameters: Hyperparameters) -> Float[Array, " terms"]:
        """Return the prior standard deviation of each term."""
        if not self.scales:
            return jnp.asarray(self.fixed)
        learnt = jnp.stack([hyperparameters[name] for name in self.scales])
        return jnp.asarray(self.fixed) + jnp.asarray(self.which) @ learnt

    def stacked(self, values: Float[Array, " terms"], fill: float = 0.0) -> Float[Array, "parameters most"]:
        """Return the terms of each parameter in a row, shorter rows filled up."""
        rows = jnp.split(values, np.cumsum(self.lengths)[:-1])
        return jnp.stack([jnp.pad(row, (0, max(self.lengths) - len(row)), constant_values=fill) for row in rows])

    def flat(self, rows: Float[Array, "parameters most"]) -> Float[Array, " terms"]:
        """Return what `stacked` was given."""
        return jnp.concatenate([row[:length] for row, length in zip(rows, self.lengths, strict=True)])


def find_terms(factors: Factors, parameters: Sequence[str], priors: Priors) -> Terms:
    """Return the terms of the linear predictors: the group, then the coordinates of each factor's effects."""
    groups = len(factors.group.labels)
    designs = [factors.design(parameter) for parameter in parameters]
    lengths = tuple(design.shape[1] for design in designs)
    scales = tuple(name for parameter in parameters for name in effect_scales(parameter, factors))
    mean, fixed = np.zeros((2, sum(lengths)))
    which = np.zeros((len(mean), len(scales)))
    for parameter, first in zip(parameters, np.cumsum((0, *lengths[:-1])), strict=True):
        here = slice(first, first + groups)
        mean[here], fixed[here] = priors[f"{parameter}_group"].parameters
        for name, (start, basis) in effects_in_terms(parameter, factors).items():
            of_effect = slice(first + start, first + start + basis.shape[1])
            which[of_effect, scales.index(f"sd_log_{parameter}_{name}")] = 1.0
    design = np.stack([np.pad(one, ((0, 0), (0, max(lengths) - one.shape[1]))) for one in designs])
    return Terms(design, lengths, mean, fixed, scales, which)


def effects_in_terms(parameter: str, factors: Factors) -> dict[str, tuple[int, np.ndarray]]:
    """Return where the coordinates of each factor start among a parameter's terms, and their basis."""
    start, places = len(factors.group.labels), {}
    for name, factor in factors.effects(parameter).items():
        places[name] = start, factor.basis
        start += factor.basis.shape[1]
    return places
