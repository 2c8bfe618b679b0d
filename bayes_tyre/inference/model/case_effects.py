"""The level of the cases: the linear predictor from their factors, a remainder, and the standard deviation of repeats.

Arrays hold all parameters at once, in the order given: what two or five of them need is one kernel, not one for each.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, override

import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.stats import norm
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, effect_scales
from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian, reparameterise, reparameterise_jointly

#: Repeats that a case without any counts as in its coordinates: an estimate without weight.
_ALMOST_NONE = 1e-6

#: Sampled hyperparameters by name.
Hyperparameters = Mapping[str, Array]


def deterministic(name: str, value: Array) -> Array:
    """Return the value, after adding it to the posterior as a deterministic site."""
    numpyro.deterministic(name, value)
    return value


def _deterministic_each(name: str, parameters: Sequence[str], values: Array) -> None:
    """Add the values of each parameter as deterministic sites, its name in place of the asterisk."""
    for parameter, value in zip(parameters, values, strict=True):
        deterministic(name.replace("*", parameter), value)


class _Improper(dist.ImproperUniform):
    """Uniform on the real numbers, without NumPyro's check of every value, which costs a few kernels a gradient."""

    @override
    def log_prob(self, value: ArrayLike) -> Array:
        return jnp.zeros(())


def sample_coordinates(site: str, shape: tuple[int, ...]) -> Array:
    """Sample coordinates with an improper uniform density; the density of what they stand for is added as factors."""
    return jnp.asarray(numpyro.sample(site, _Improper(dist.constraints.real, (), shape)))


def sample_reparameterised(site: str, estimate: Gaussian, above: ArrayLike, scale: ArrayLike) -> Array:
    """Sample unknowns that are Normal(above, scale), in coordinates that follow that scale and the data's estimate."""
    above, scale = jnp.asarray(above), jnp.asarray(scale)
    unknown = reparameterise(sample_coordinates(f"{site}_z", estimate.value.shape), estimate, above, scale)
    numpyro.factor(f"{site}_density", norm.logpdf(unknown.deviation, 0.0, scale) + unknown.log_volume)
    return unknown.value


def _of_each(name: str, parameters: Sequence[str], hyperparameters: Hyperparameters) -> Float[Array, "parameters 1"]:
    """Return a hyperparameter for each parameter, its name in place of the asterisk."""
    return jnp.stack([hyperparameters[name.replace("*", parameter)] for parameter in parameters])[:, None]


class Terms(NamedTuple):
    """The terms of the linear predictors, stacked over parameters; where one has fewer terms, idle ones follow.

    Attributes
    ----------
    design:
        Shape (parameters, cases, terms): what each term adds to each case; 0 for idle ones.
    lengths:
        Terms of each parameter that are not idle.
    above, fixed:
        Shape (parameters, terms): mean of each term, and its standard deviation where that is no scale to be learnt: a
        group mean's, and 1 for idle ones.
    scales, which:
        Names of the scales, and the share that each has in the standard deviation of each term, 0 or 1, shape
        (parameters, terms, scales).
    """

    design: Float[np.ndarray, "parameters cases terms"]
    lengths: tuple[int, ...]
    above: Float[np.ndarray, "parameters terms"]
    fixed: Float[np.ndarray, "parameters terms"]
    scales: tuple[str, ...]
    which: Float[np.ndarray, "parameters terms scales"]

    def scale(self, hyperparameters: Hyperparameters) -> Float[Array, "parameters terms"]:
        """Return the standard deviation of each term."""
        if not self.scales:
            return jnp.asarray(self.fixed)
        learnt = jnp.stack([hyperparameters[name] for name in self.scales])
        return jnp.asarray(self.fixed) + jnp.asarray(self.which) @ learnt


def find_terms(factors: Factors, parameters: Sequence[str], priors: Priors = PRIORS) -> Terms:
    """Return the terms of the linear predictors: the group, then the coordinates of each factor's effects."""
    cells = len(factors.group.labels)
    designs = [factors.design(parameter) for parameter in parameters]
    lengths = tuple(design.shape[1] for design in designs)
    scales = tuple(name for parameter in parameters for name in effect_scales(parameter, factors))
    above, fixed = np.zeros((2, len(parameters), max(lengths)))
    which = np.zeros((*fixed.shape, len(scales)))
    for i, parameter in enumerate(parameters):
        above[i, :cells], fixed[i, :cells] = priors[f"{parameter}_group"].parameters
        fixed[i, lengths[i] :] = 1.0
        for name, (start, basis) in _effects(parameter, factors).items():
            which[i, start : start + basis.shape[1], scales.index(f"sd_log_{parameter}_{name}")] = 1.0
    design = np.stack([np.pad(one, ((0, 0), (0, max(lengths) - one.shape[1]))) for one in designs])
    return Terms(design, lengths, above, fixed, scales, which)


def _effects(parameter: str, factors: Factors) -> dict[str, tuple[int, np.ndarray]]:
    """Return where the coordinates of each factor start among a parameter's terms, and their basis."""
    start, found = len(factors.group.labels), {}
    for name, factor in factors.effects(parameter).items():
        found[name] = start, factor.basis
        start += factor.basis.shape[1]
    return found


def linear_predictor(
    factors: Factors,
    estimate: Gaussian,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> Float[Array, "parameters cases"]:
    """Return the linear predictor of the logarithm of k (kN/mm) and of beta (mm) of each case.

    Configuration x direction, plus partially pooled speed, initial load and size of the step (for beta
    direction x step too). A factor with one level has no term. Effects lie in their factor's basis and sum to zero:
    otherwise what the levels share would be in the group means as well, and the sampler would crawl along that ridge.

    `estimate` shapes the coordinates: the data's estimate of each case, with its precision about the linear predictor.
    """
    terms = find_terms(factors, parameters, priors)
    scale = terms.scale(hyperparameters)
    pieces = jnp.split(sample_coordinates("words_z", (sum(terms.lengths),)), np.cumsum(terms.lengths)[:-1])
    z = jnp.stack([jnp.pad(piece, (0, scale.shape[1] - len(piece))) for piece in pieces])
    effects = reparameterise_jointly(z, terms.design, estimate, terms.above, scale)
    numpyro.factor("words_density", norm.logpdf(effects.deviation, 0.0, scale))
    numpyro.factor("words_volume", effects.log_volume)
    for parameter, value in zip(parameters, effects.value, strict=True):
        deterministic(f"{parameter}_group", jnp.exp(value[: len(factors.group.labels)]))
        for name, (start, basis) in _effects(parameter, factors).items():
            deterministic(f"log_{parameter}_{name}", jnp.asarray(basis) @ value[start : start + basis.shape[1]])
    return jnp.einsum("pct,pt->pc", jnp.asarray(terms.design), effects.value)


def _repeat_scatter(
    factors: Factors, estimate: Gaussian, hyperparameters: Hyperparameters, parameters: Sequence[str]
) -> Float[Array, "parameters cases"]:
    """Return the standard deviation of log k and log beta among repeats of each case, partially pooled over speeds."""
    typical = _of_each("sd_log_*_repeat", parameters, hyperparameters)
    if not factors.speed.varies:
        return jnp.broadcast_to(typical, (len(parameters), len(factors.cases)))
    spread = _of_each("sd_log_*_repeat_over_speeds", parameters, hyperparameters)
    scatter = jnp.exp(sample_reparameterised("repeat_scatter", estimate, jnp.log(typical), spread))
    _deterministic_each("sd_log_*_repeat_by_speed", parameters, scatter)
    return scatter[:, factors.speed.of_case]


class CaseDistribution(NamedTuple):
    """The distribution of the logarithms of the cases' values, and of repeats about them.

    Attributes
    ----------
    mean:
        The linear predictor.
    remainder:
        Standard deviation of the cases about it; 0 for a parameter whose cases have no remainder.
    scatter:
        Standard deviation of repeats about their case.
    estimate:
        The records' own estimate of each case, with its precision.
    has_remainder:
        Indices of the parameters whose cases have one.
    """

    mean: Float[Array, "parameters cases"]
    remainder: Float[Array, "parameters 1"]
    scatter: Float[Array, "parameters cases"]
    estimate: Gaussian
    has_remainder: Sequence[int]


def case_distribution(
    factors: Factors,
    estimates: CaseEstimates,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> CaseDistribution:
    """Return the linear predictor of each case, with the standard deviations of cases and repeats about it.

    Where a remainder is not identified beside the repeats or the effects, there is none.
    """
    scatter = _repeat_scatter(factors, estimates.log_scatter, hyperparameters, parameters)
    repeats = np.maximum(factors.repeats, _ALMOST_NONE)
    variance = (scatter**2 + estimates.variance) / jnp.asarray(repeats)
    rest = [index for index, parameter in enumerate(parameters) if factors.has_remainder(parameter)]
    remainder = jnp.zeros((len(parameters), 1))
    if rest:
        of_rest = _of_each("sd_log_*_case", [parameters[index] for index in rest], hyperparameters)
        remainder = of_rest if len(rest) == len(parameters) else remainder.at[np.array(rest)].set(of_rest)
    about_predictor = Gaussian(estimates.middle, 1.0 / (variance + remainder**2))
    mean = linear_predictor(factors, about_predictor, hyperparameters, parameters, priors)
    return CaseDistribution(mean, remainder, scatter, Gaussian(estimates.middle, 1.0 / variance), rest)


def sample_cases(site: str, about: CaseDistribution) -> Float[Array, "parameters cases"]:
    """Sample the logarithms of the cases' values: the linear predictor, plus a remainder where there is one."""
    rest = about.has_remainder
    if not rest:
        return about.mean
    here = np.array(rest) if len(rest) < len(about.mean) else slice(None)
    own = Gaussian(about.estimate.value[here], about.estimate.precision[here])
    return about.mean.at[here].set(sample_reparameterised(site, own, about.mean[here], about.remainder[here]))


def record_cases(parameters: Sequence[str], log_values: Float[Array, "parameters cases"]) -> None:
    """Add the values of the cases to the posterior."""
    _deterministic_each("*_case", parameters, jnp.exp(log_values))
