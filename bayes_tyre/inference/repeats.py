"""How the records of a case scatter about it: usual and discordant ones, with heavy tails, or normally."""

import jax
import jax.numpy as jnp
import numpyro
from jax.scipy.special import gammaln
from jax.scipy.stats import norm
from jaxtyping import Array, Float

from bayes_tyre.inference.cases import Populations
from bayes_tyre.inference.levels import Levels
from bayes_tyre.inference.populations import JUDGEABLE_REPEATS
from bayes_tyre.inference.priors import DISCORDANT_WIDENING

REPEATS = ("mixture", "student", "normal")


def judgeable(kind: str, levels: Levels) -> str:
    """Return the kind of scatter that the data can tell: two repeats that differ cannot say which of them is odd."""
    return kind if levels.repeats.max() >= JUDGEABLE_REPEATS else "normal"


def repeats_about_cases(
    deviation: Float[Array, "records parameters"],
    scatter: Float[Array, "records parameters"],
    kind: str,
    populations: Populations,
) -> None:
    """Add the density of the logarithms of the records' parameters about their cases.

    Of a mixture the discordant records scatter more widely: the indicator of each is summed out, and its posterior
    probability is `discordant_probability`. Of a Student-t all parameters scatter more widely together, as one draw
    does.
    """

    def about_case(widening: float) -> Float[Array, " records"]:
        return norm.logpdf(deviation, 0.0, widening * scatter).sum(axis=1)

    if kind == "normal":
        numpyro.factor("repeats", about_case(1.0))
        return
    if kind == "student":
        nu, half = populations["student_nu"], 0.5 * scatter.shape[1]
        # A t on independent axes: a normal whose variance is nu over a chi-squared number of nu degrees.
        squares = jnp.sum((deviation / scatter) ** 2, axis=1)
        volume = gammaln(0.5 * nu + half) - gammaln(0.5 * nu) - half * jnp.log(nu * jnp.pi)
        volume = volume - jnp.sum(jnp.log(scatter), axis=1)
        numpyro.factor("repeats", volume - (0.5 * nu + half) * jnp.log1p(squares / nu))
        return
    weight = populations["discordant_weight"]
    usual = jnp.log1p(-weight) + about_case(1.0)
    discordant = jnp.log(weight) + about_case(DISCORDANT_WIDENING)
    numpyro.factor("repeats", jnp.logaddexp(usual, discordant))
    numpyro.deterministic("discordant_probability", jax.nn.sigmoid(discordant - usual))
