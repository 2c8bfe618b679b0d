"""How the records of a case scatter about it: usual and discordant ones, with heavy tails, or normally."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpyro
from jax.scipy.special import gammaln
from jax.scipy.stats import norm
from jaxtyping import Array, Float

from bayes_tyre.inference.model.case_effects import Hyperparameters
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS

REPEATS = ("mixture", "student", "normal")


def judgeable(kind: str, factors: Factors) -> str:
    """Return the kind of scatter that the data can tell: two repeats that differ cannot say which of them is odd."""
    return kind if factors.repeats.max() >= JUDGEABLE_REPEATS else "normal"


class RepeatDensity(NamedTuple):
    """How the records lie about their cases: log density of each, and the probability that it is discordant.

    The probability is None where repeats are not a mixture.
    """

    log_density: Float[Array, " records"]
    discordant: Float[Array, " records"] | None = None


def repeat_density(
    deviation: Float[Array, "records parameters"],
    scatter: Float[Array, "records parameters"],
    kind: str,
    hyperparameters: Hyperparameters,
    widening: float = DISCORDANT_WIDENING,
) -> RepeatDensity:
    """Return the density of the logarithms of the records' parameters about their cases.

    Of a mixture the discordant records scatter more widely, and the indicator of each is summed out. Of a Student-t all
    parameters scatter more widely together, as one draw does.
    """

    def normal(widening: float) -> Float[Array, " records"]:
        return norm.logpdf(deviation, 0.0, widening * scatter).sum(axis=1)

    if kind == "normal":
        return RepeatDensity(normal(1.0))
    if kind == "student":
        nu, half = hyperparameters["student_nu"], 0.5 * scatter.shape[1]
        # A t on independent axes: a normal whose variance is nu over a chi-squared number of nu degrees.
        squares = jnp.sum((deviation / scatter) ** 2, axis=1)
        volume = gammaln(0.5 * nu + half) - gammaln(0.5 * nu) - half * jnp.log(nu * jnp.pi)
        volume = volume - jnp.sum(jnp.log(scatter), axis=1)
        return RepeatDensity(volume - (0.5 * nu + half) * jnp.log1p(squares / nu))
    weight = hyperparameters["discordant_weight"]
    usual = jnp.log1p(-weight) + normal(1.0)
    discordant = jnp.log(weight) + normal(widening)
    return RepeatDensity(jnp.logaddexp(usual, discordant), jax.nn.sigmoid(discordant - usual))


def add_repeat_density(
    deviation: Float[Array, "records parameters"],
    scatter: Float[Array, "records parameters"],
    kind: str,
    hyperparameters: Hyperparameters,
    widening: float = DISCORDANT_WIDENING,
) -> None:
    """Add `repeat_density` to a model; keep the probability that each record is discordant where there is one."""
    found = repeat_density(deviation, scatter, kind, hyperparameters, widening)
    numpyro.factor("repeats", found.log_density)
    if found.discordant is not None:
        numpyro.deterministic("outlier_probability", found.discordant)
