"""How the records of a case scatter about it: usual and discordant ones, with heavy tails, or normally."""

from typing import override

import jax
import jax.numpy as jnp
from jax.scipy.special import gammaln
from jax.scipy.stats import norm
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import constraints

from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS, Hyperparameters

REPEATS = ("mixture", "student", "normal")


def judgeable(kind: str, factors: Factors) -> str:
    """Return the kind of scatter that the data can tell: two repeats that differ cannot say which is discordant."""
    return kind if factors.repeats.max() >= JUDGEABLE_REPEATS else "normal"


class RepeatsAboutCases(dist.Distribution):
    """The logarithms of the values of all records, normal about those of their cases; batch shape (records,).

    Parameters
    ----------
    case, scatter:
        The logarithms of the values of each record's case, and the standard deviation of usual records about it.
    """

    support = constraints.real_vector  # pyright: ignore[reportAssignmentType]  (as all of NumPyro's)

    def __init__(self, case: Float[Array, "records parameters"], scatter: Float[Array, "records parameters"]) -> None:
        self.case, self.scatter = case, scatter
        super().__init__(case.shape[:1], case.shape[1:], validate_args=False)

    @override
    def sample(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample records parameters"]:
        """Draw the records' values."""
        of_widening, of_repeat = jax.random.split(key)
        shape = self.shape(sample_shape)
        widening = self._draw_widening(of_widening, shape[:-1])[..., None]
        return self.case + widening * self.scatter * jax.random.normal(of_repeat, shape)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " records"]:
        """Return the log density of each record's values."""
        return self._log_normal(value, 1.0)

    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        """Draw how many times wider than usual each record scatters."""
        del key
        return jnp.ones(shape)

    def _log_normal(self, value: ArrayLike, widening: float) -> Float[Array, " records"]:
        return norm.logpdf(jnp.asarray(value), self.case, widening * self.scatter).sum(axis=-1)


class StudentRepeats(RepeatsAboutCases):
    """Repeats with heavy tails: all parameters of a record scatter more widely together, as one draw does."""

    def __init__(
        self,
        case: Float[Array, "records parameters"],
        scatter: Float[Array, "records parameters"],
        nu: Float[Array, ""],
    ) -> None:
        self.nu = nu
        super().__init__(case, scatter)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " records"]:
        """Return the log density of each record's values."""
        # A t on independent axes: a normal whose variance is nu over a chi-squared number of nu degrees.
        nu, half = self.nu, 0.5 * self.event_shape[0]
        squares = jnp.sum(((value - self.case) / self.scatter) ** 2, axis=-1)
        log_volume = gammaln(0.5 * nu + half) - gammaln(0.5 * nu) - half * jnp.log(nu * jnp.pi)
        log_volume = log_volume - jnp.sum(jnp.log(self.scatter), axis=-1)
        return log_volume - (0.5 * nu + half) * jnp.log1p(squares / nu)

    @override
    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return jnp.sqrt(0.5 * self.nu / jax.random.gamma(key, 0.5 * self.nu, shape))


class MixtureRepeats(RepeatsAboutCases):
    """Usual and discordant repeats, which scatter more widely; which ones they are is summed out.

    Parameters
    ----------
    weight, widening:
        Probability that a record is discordant, and how many times `scatter` it then scatters.
    """

    def __init__(
        self,
        case: Float[Array, "records parameters"],
        scatter: Float[Array, "records parameters"],
        weight: Float[Array, ""],
        widening: float,
    ) -> None:
        self.weight, self.widening = weight, widening
        super().__init__(case, scatter)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " records"]:
        """Return the log density of each record's values, usual or discordant."""
        return jnp.logaddexp(*self._log_each(value))

    def discordant(self, value: Float[Array, "records parameters"]) -> Float[Array, " records"]:
        """Return the probability that each record is discordant, given its case."""
        usual, discordant = self._log_each(value)
        return jax.nn.sigmoid(discordant - usual)

    @override
    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return jnp.where(jax.random.bernoulli(key, self.weight, shape), self.widening, 1.0)

    def _log_each(self, value: ArrayLike) -> tuple[Float[Array, " records"], Float[Array, " records"]]:
        """Return the log densities of usual and of discordant records."""
        usual = jnp.log1p(-self.weight) + self._log_normal(value, 1.0)
        return usual, jnp.log(self.weight) + self._log_normal(value, self.widening)


def repeats_about_cases(
    kind: str,
    case: Float[Array, "records parameters"],
    scatter: Float[Array, "records parameters"],
    hyperparameters: Hyperparameters,
    widening: float,
) -> RepeatsAboutCases:
    """Return the distribution of repeats of a kind of `REPEATS`."""
    if kind == "mixture":
        return MixtureRepeats(case, scatter, hyperparameters["discordant_weight"], widening)
    if kind == "student":
        return StudentRepeats(case, scatter, hyperparameters["student_nu"])
    return RepeatsAboutCases(case, scatter)
