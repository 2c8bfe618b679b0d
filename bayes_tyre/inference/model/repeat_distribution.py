"""How records scatter about their case, and cases about their linear predictor: normally, or with heavier tails."""

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
    return kind if factors.most_repeats >= JUDGEABLE_REPEATS else "normal"


class NormalAbout(dist.Distribution):
    """Units about their centres, such as records about their cases; batch shape (units,), event shape (parameters,).

    Parameters
    ----------
    centre, sd:
        Where each unit is about, and its standard deviation if it is a usual one.
    """

    support = constraints.real_vector  # pyright: ignore[reportAssignmentType]  (as all of NumPyro's)

    def __init__(self, centre: Float[Array, "units parameters"], sd: Float[Array, "units parameters"]) -> None:
        self.centre, self.sd = centre, sd
        super().__init__(centre.shape[:1], centre.shape[1:], validate_args=False)

    @override
    def sample(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample units parameters"]:
        """Draw the units."""
        of_widening, of_unit = jax.random.split(key)
        shape = self.shape(sample_shape)
        widening = self._draw_widening(of_widening, shape[:-1])[..., None]
        return self.centre + widening * self.sd * jax.random.normal(of_unit, shape)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " units"]:
        """Return the log density of each unit."""
        return self._log_normal(value, 1.0)

    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        """Draw how many times wider than usual each unit scatters."""
        del key
        return jnp.ones(shape)

    def _log_normal(self, value: ArrayLike, widening: float) -> Float[Array, " units"]:
        return norm.logpdf(jnp.asarray(value), self.centre, widening * self.sd).sum(axis=-1)


class StudentAbout(NormalAbout):
    """Units with heavy tails: all parameters of a unit scatter more widely together, as one draw does."""

    def __init__(
        self, centre: Float[Array, "units parameters"], sd: Float[Array, "units parameters"], nu: Float[Array, ""]
    ) -> None:
        self.nu = nu
        super().__init__(centre, sd)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " units"]:
        """Return the log density of each unit."""
        # A t on independent axes: a normal whose variance is nu over a chi-squared number of nu degrees.
        nu, half = self.nu, 0.5 * self.event_shape[0]
        squares = jnp.sum(((value - self.centre) / self.sd) ** 2, axis=-1)
        log_volume = gammaln(0.5 * nu + half) - gammaln(0.5 * nu) - half * jnp.log(nu * jnp.pi)
        log_volume = log_volume - jnp.sum(jnp.log(self.sd), axis=-1)
        return log_volume - (0.5 * nu + half) * jnp.log1p(squares / nu)

    @override
    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return jnp.sqrt(0.5 * self.nu / jax.random.gamma(key, 0.5 * self.nu, shape))


class MixtureAbout(NormalAbout):
    """Usual units, and some that scatter more widely: discordant repeats, or cases that stand apart.

    Which ones they are is summed out.

    Parameters
    ----------
    weight, widening:
        Probability that a unit scatters more widely, and how many times `sd` it then does.
    """

    def __init__(
        self,
        centre: Float[Array, "units parameters"],
        sd: Float[Array, "units parameters"],
        weight: Float[Array, ""],
        widening: float,
    ) -> None:
        self.weight, self.widening = weight, widening
        super().__init__(centre, sd)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " units"]:
        """Return the log density of each unit, usual or not."""
        return jnp.logaddexp(*self._log_each(value))

    def probability(self, value: Float[Array, "units parameters"]) -> Float[Array, " units"]:
        """Return the probability that each unit is one of those that scatter more widely, given its centre."""
        usual, wider = self._log_each(value)
        return jax.nn.sigmoid(wider - usual)

    @override
    def _draw_widening(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return jnp.where(jax.random.bernoulli(key, self.weight, shape), self.widening, 1.0)

    def _log_each(self, value: ArrayLike) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        """Return the log densities of usual units and of those that scatter more widely."""
        usual = jnp.log1p(-self.weight) + self._log_normal(value, 1.0)
        return usual, jnp.log(self.weight) + self._log_normal(value, self.widening)


def repeats_about_cases(
    kind: str,
    case: Float[Array, "records parameters"],
    sd_repeat: Float[Array, "records parameters"],
    hyperparameters: Hyperparameters,
    widening: float,
) -> NormalAbout:
    """Return the distribution of repeats of a kind of `REPEATS`."""
    if kind == "mixture":
        return MixtureAbout(case, sd_repeat, hyperparameters["discordant_weight"], widening)
    if kind == "student":
        return StudentAbout(case, sd_repeat, hyperparameters["student_nu"])
    return NormalAbout(case, sd_repeat)
