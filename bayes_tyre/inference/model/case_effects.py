"""The level of the cases: the linear predictor from their factors, a remainder, and the standard deviation of repeats.

Arrays hold all parameters at once, in the order given: what two or five of them need is one kernel, not one for each.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import (
    PARAMETERS,
    Hyperparameters,
    apart_weight,
    deterministic,
    deterministic_each,
    of_each,
)
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import COVARIATE
from bayes_tyre.inference.model.terms import effects_in_terms, find_terms

#: Site of what specimen, day and covariates add to the logarithms of the records' values.
OFFSET = "record_offset"


def sample_linear_predictor(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS, priors: Priors = PRIORS
) -> Float[Array, "parameters cases"]:
    """Sample the linear predictor of the logarithm of k (kN/mm) and of beta (mm) of each case.

    Configuration x direction, plus partially pooled speed, initial load and size of the step (for beta direction x step
    too), and configuration x speed and x initial load. A factor with one level has no term. Effects lie in their
    factor's basis and sum to zero: otherwise what the levels share would be in the group means as well, and the sampler
    would crawl along that ridge.
    """
    terms = find_terms(factors, parameters, priors)
    sampled = numpyro.sample("terms", dist.Normal(terms.mean, terms.sd(hyperparameters)).to_event(1))
    predictors = []
    for parameter, value in zip(parameters, terms.stacked(jnp.asarray(sampled)), strict=True):
        log_group_means = value[: len(factors.group.labels)]
        deterministic(f"{parameter}_group", jnp.exp(log_group_means))
        predictor, effects = log_group_means[factors.group.of_case], factors.effects(parameter)
        for name, (start, basis) in effects_in_terms(parameter, factors).items():
            effect = jnp.asarray(basis) @ value[start : start + basis.shape[1]]
            deterministic(f"log_{parameter}_{name}", effect)
            predictor = predictor + effect[effects[name].of_case] * effects[name].weight
        predictors.append(predictor)
    return jnp.stack(predictors)


def sample_sd_by_speed(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS, of: str = "repeat"
) -> dict[str, Array]:
    """Sample the standard deviation of repeats at each speed, partially pooled; nothing where speed does not vary.

    `of` is what scatters: ``repeat``, or ``published`` case means.
    """
    if not factors.speed.varies:
        return {}
    typical, sd_over_speeds = (
        of_each(f"sd_log_*_{of}{ending}", parameters, hyperparameters) for ending in ("", "_over_speeds")
    )
    shape = (len(parameters), len(factors.speed.labels))
    by_speed = dist.Normal(jnp.log(typical), sd_over_speeds).expand(shape).to_event(2)
    sds = jnp.exp(jnp.asarray(numpyro.sample(f"log_sd_{of}_by_speed", by_speed)))
    deterministic_each(f"sd_log_*_{of}_by_speed", parameters, sds)
    return {f"sd_log_{name}_{of}_by_speed": sd for name, sd in zip(parameters, sds, strict=True)}


def sample_offset(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS, priors: Priors = PRIORS
) -> Float[Array, "records parameters"]:
    """Sample what specimen, day and covariates add to the logarithms of each record's values."""
    levels, effects = factors.levels, dict[str, Array]()
    for name, level in levels.groupings.items():
        sd = of_each(f"sd_log_*_{name}", parameters, hyperparameters)
        fn = dist.Normal(0.0, sd).expand((len(parameters), len(level.labels))).to_event(2)
        effects[name] = jnp.asarray(numpyro.sample(f"log_{name}", fn))
    if levels.covariates is not None:
        mean, sd = np.transpose([priors[f"log_{parameter}_{COVARIATE}"].parameters for parameter in parameters])
        fn = dist.Normal(mean[:, None], sd[:, None]).expand((len(parameters), len(levels.covariates.names)))
        effects[COVARIATE] = jnp.asarray(numpyro.sample(f"log_{COVARIATE}", fn.to_event(2)))
    for name, values in effects.items():
        deterministic_each(f"log_*_{name}", parameters, values)
    return deterministic(OFFSET, jnp.asarray(levels.offset(effects.__getitem__)).T)


def sd_about_cases(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS, of: str = "repeat"
) -> Float[Array, "parameters cases"]:
    """Return the standard deviation of repeats, or of ``published`` means, about each case, relative."""
    if factors.speed.varies:
        by_speed = [hyperparameters[f"sd_log_{parameter}_{of}_by_speed"] for parameter in parameters]
        return jnp.stack(by_speed)[:, factors.speed.of_case]
    typical = of_each(f"sd_log_*_{of}", parameters, hyperparameters)
    return jnp.broadcast_to(typical, (len(parameters), len(factors.cases)))


def with_remainder(factors: Factors, parameters: Sequence[str] = PARAMETERS) -> np.ndarray:
    """Return the indices of the parameters whose cases have a remainder.

    Where one is not identified beside the repeats or the effects, there is none.
    """
    return np.flatnonzero([factors.has_remainder(parameter) for parameter in parameters])


def case_remainder(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS
) -> Float[Array, "parameters 1"]:
    """Return the standard deviation of cases about their linear predictor, relative; 0 where there is no remainder."""
    rest = with_remainder(factors, parameters)
    if not len(rest):
        return jnp.zeros((len(parameters), 1))
    sd = of_each("sd_log_*_case", [str(parameters[index]) for index in rest], hyperparameters)
    return sd if len(rest) == len(parameters) else jnp.zeros((len(parameters), 1)).at[rest].set(sd)


class CaseDistribution(NamedTuple):
    """The distribution of the logarithms of the cases' values, and of repeats about them.

    Cases are normal about their linear predictor, but for a few that stand apart from the others, in each parameter by
    itself: so a case whose repeats agree keeps its value, however unlike the others it is.

    Attributes
    ----------
    mean:
        The linear predictor.
    remainder:
        Standard deviation of the cases about it; 0 for a parameter whose cases have no remainder.
    sd_repeat:
        Standard deviation of repeats about their case.
    apart_weight, apart_widening:
        Probability that a case stands apart, 0 in a model without such cases; and how many times `remainder` its
        standard deviation then is.
    offset:
        What its specimen, day and covariates add to each record, beside what it has of its case.

    Source: the contaminated normal of Tukey (1960), "A survey of sampling from contaminated distributions".
    """

    mean: Float[Array, "parameters cases"]
    remainder: Float[Array, "parameters #cases"]
    sd_repeat: Float[Array, "parameters cases"]
    apart_weight: float
    apart_widening: float
    offset: Float[Array | np.ndarray, "#records #parameters"]

    def remainders(self) -> tuple[Float[np.ndarray, " kinds"], Float[Array, "kinds parameters #cases"]]:
        """Return log probability, and standard deviation about the linear predictor, of each kind of case.

        The usual ones, then those that stand apart if there are any.
        """
        widening = np.array([1.0, self.apart_widening][: 2 if self.apart_weight else 1])
        log_weight = np.log([1.0 - self.apart_weight, self.apart_weight][: len(widening)])
        return log_weight, jnp.asarray(widening)[:, None, None] * self.remainder

    def draw_cases(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample parameters cases"]:
        """Draw the logarithms of the cases' values."""
        which, of_case = jax.random.split(key)
        shape = (*sample_shape, *self.mean.shape)
        apart = jax.random.bernoulli(which, self.apart_weight, shape)
        sd = jnp.where(apart, self.apart_widening, 1.0) * self.remainder
        return self.mean + sd * jax.random.normal(of_case, shape)


def sample_case_distribution(
    factors: Factors, hyperparameters: Hyperparameters, parameters: Sequence[str] = PARAMETERS, priors: Priors = PRIORS
) -> CaseDistribution:
    """Sample what the cases are distributed by."""
    with_sd = {**hyperparameters, **sample_sd_by_speed(factors, hyperparameters, parameters)}
    offset = sample_offset(factors, with_sd, parameters, priors) if factors.levels.names else np.zeros((1, 1))
    mean = sample_linear_predictor(factors, with_sd, parameters, priors)
    remainder, sd_repeat = (of(factors, with_sd, parameters) for of in (case_remainder, sd_about_cases))
    weight = apart_weight(factors, parameters, priors)
    return CaseDistribution(mean, remainder, sd_repeat, weight, priors.apart_widening, offset)
