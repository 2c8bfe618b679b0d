"""Reparameterisations for NumPyro's effect handlers, one for each kind of site of the models.

The mathematics is in `reparameterisation`.
"""

from collections.abc import Callable, Mapping
from typing import Any, cast, override

import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.stats import norm
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro import handlers
from numpyro.distributions import constraints, transforms
from numpyro.infer.reparam import ExplicitReparam, Reparam

from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates
from bayes_tyre.inference.model.coordinates.reparameterisation import (
    Gaussian,
    Reparameterised,
    reparameterise,
    reparameterise_jointly,
)
from bayes_tyre.inference.model.hyperparameters import Hyperparameters, standard_normals
from bayes_tyre.inference.model.marginal_mixture import RepeatsOfCases, case_given_choice, choice_number
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation
from bayes_tyre.inference.model.repeat_distribution import NormalAbout
from bayes_tyre.inference.model.terms import Terms

#: By site: its reparameterisation, given the values of the sites before it.
Coordinates = Mapping[str, Callable[[Hyperparameters], Reparam]]
#: Reparameterises the records' logarithms, given their coordinates, and mean and standard deviation of each about its
#: case.
Reparameterisation = Callable[
    [Array, Float[Array, "records parameters"], Float[Array, "records parameters"]], Reparameterised
]


class InCoordinates(handlers.reparam):
    """`handlers.reparam` whose reparameterisations follow the values sampled before them; half-normals as well.

    Parameters
    ----------
    fn:
        The model.
    coordinates:
        By site.
    """

    def __init__(self, fn: Callable[..., None], coordinates: Coordinates) -> None:
        self._values: dict[str, Any] = {}
        self._coordinates = coordinates
        super().__init__(fn, config=self._reparam)

    @override
    def postprocess_message(self, msg: Any) -> None:
        if "name" in msg:  # a request for a key has none
            self._values[msg["name"]] = msg["value"]

    def _reparam(self, site: Any) -> Reparam | None:
        if isinstance(site["fn"], dist.HalfNormal):
            return ExplicitReparam(softplus(site["fn"]).inv)
        return self._coordinates[site["name"]](self._values) if site["name"] in self._coordinates else None


def softplus(fn: dist.HalfNormal) -> transforms.ComposeTransform:
    """Return the map to a half-normal from the inverse softplus of its value over its scale.

    NumPyro takes the logarithm of what is above zero. There a half-normal falls off like exp(-exp(2 z) / 2) on the
    right: of a weakly identified standard deviation, NUTS learns long steps from the long tail on the
    left, and with these it diverges at the wall. Here z is the logarithm on the left, as before, and on the right the
    value itself, of which a half-normal is normal.
    """
    times = transforms.AffineTransform(0.0, cast(Any, fn.scale), domain=constraints.positive)
    return transforms.ComposeTransform([transforms.SoftplusTransform(), times])


class _Improper(dist.ImproperUniform):
    """Uniform on the real numbers, without NumPyro's check of every value, which costs a few kernels a gradient."""

    @override
    def log_prob(self, value: ArrayLike) -> Array:
        return jnp.zeros(())


def sample_coordinates(site: str, shape: tuple[int, ...]) -> Array:
    """Sample coordinates with an improper uniform density; the density of what they stand for is added as factors."""
    return jnp.asarray(numpyro.sample(site, _Improper(constraints.real, (), shape)))


def _mean_and_sd(fn: Any) -> tuple[Array, Array]:
    """Return mean and standard deviation of independent normals, however wrapped."""
    while isinstance(fn, (dist.Independent, dist.ExpandedDistribution)):
        fn = fn.base_dist
    return jnp.asarray(fn.loc), jnp.asarray(fn.scale)


class NormalReparam(Reparam):
    """Independent normals, in coordinates that follow their own scale and an estimate from the data."""

    def __init__(self, estimate: Gaussian) -> None:
        self.estimate = estimate

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        mean, sd = _mean_and_sd(fn)
        unknown = reparameterise(sample_coordinates(f"{name}_z", fn.shape()), self.estimate, mean, sd)
        numpyro.factor(f"{name}_density", norm.logpdf(unknown.deviation, 0.0, sd) + unknown.log_volume)
        return None, unknown.value


class TermsReparam(Reparam):
    """The terms of the linear predictors, which the estimates of all cases determine together.

    Parameters
    ----------
    terms:
        The terms.
    estimate:
        Of them, shape (parameters, most).
    """

    def __init__(self, terms: Terms, estimate: QuadraticApproximation) -> None:
        self.terms, self.estimate = terms, estimate

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        terms, (mean, sd), z = self.terms, _mean_and_sd(fn), sample_coordinates(f"{name}_z", fn.shape())
        rows = terms.stacked(mean), terms.stacked(sd, fill=1.0)
        unknown = reparameterise_jointly(terms.stacked(z), self.estimate, *rows)
        numpyro.factor(f"{name}_density", norm.logpdf(terms.flat(unknown.deviation), 0.0, sd))
        numpyro.factor(f"{name}_volume", unknown.log_volume)
        return None, terms.flat(unknown.value)


class CasesReparam(Reparam):
    """The cases' logarithms about their linear predictor, in coordinates that follow their estimates.

    Parameters
    ----------
    estimate:
        Of each parameter of each case, shape (units, 1).
    widening:
        How many times wider than usual each is expected about its linear predictor, likewise.
    """

    def __init__(self, estimate: Gaussian, widening: Float[Array, "units 1"]) -> None:
        self.estimate, self.widening = estimate, widening

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        assert isinstance(fn, NormalAbout)
        z = sample_coordinates(f"{name}_z", fn.shape())
        cases = reparameterise(z, self.estimate, fn.centre, self.widening * fn.sd)
        numpyro.factor(f"{name}_density", jnp.sum(fn.log_prob(cases.value)) + jnp.sum(cases.log_volume))
        return None, cases.value


class RecordsReparam(Reparam):
    """The records' logarithms, in coordinates that follow their case and their own estimates.

    Where cases are integrated out, coordinates need a case to follow: an auxiliary value of it, given one fixed choice
    of discordant repeats and of cases that stand apart, those that look so by their estimates. Given that choice
    everything is normal, so weakly identified records follow what their case shares, and no discordant repeat makes a
    second mode. What is sampled is the records, whose density is that over all choices, and the auxiliary value, whose
    density is its conditional given the records and the one choice: what it adds integrates to 1.

    Parameters
    ----------
    reparameterisation:
        Of the records' logarithms.
    estimates:
        Of the cases, which of them look as if they stood apart, and which records look discordant.
    variance:
        Of the estimate of each case.
    rest:
        Indices of the parameters whose cases have a remainder.
    """

    def __init__(
        self,
        reparameterisation: Reparameterisation,
        estimates: CaseEstimates,
        variance: Float[Array, "parameters cases"],
        rest: np.ndarray,
    ) -> None:
        self.reparameterisation, self.estimates = reparameterisation, estimates
        self.variance, self.rest = variance, rest

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        if isinstance(fn, RepeatsOfCases):
            return None, self._about_auxiliary_cases(name, fn)
        records = self._reparameterised(name, fn.centre, fn.sd)
        numpyro.factor(f"{name}_density", fn.log_prob(records.value))
        return None, records.value

    def _reparameterised(self, name: str, case: Array, sd_repeat: Array) -> Reparameterised:
        records = self.reparameterisation(sample_coordinates(f"{name}_z", case.shape), case, sd_repeat)
        numpyro.factor(f"{name}_volume", records.log_volume)
        return records

    def _about_auxiliary_cases(self, name: str, fn: RepeatsOfCases) -> Float[Array, "records parameters"]:
        rest, about = self.rest, fn.about
        discordant = self.estimates.discordant & fn.members.choices.any()
        auxiliary = self._auxiliary_cases(name, fn)
        numpyro.deterministic(f"{name}_auxiliary", auxiliary)
        cases = about.mean.at[rest].set(auxiliary) if len(rest) else about.mean
        sd_repeat = jnp.where(discordant[:, None], fn.widening, 1.0) * about.sd_repeat.T[fn.of_record]
        records = self._reparameterised(name, cases.T[fn.of_record] + about.offset, sd_repeat).value
        posterior = fn.given(records)
        numpyro.factor(f"{name}_density", posterior.log_density)
        if len(rest):
            kind = jnp.where(self.estimates.apart, len(posterior.mean) - 1, 0)
            mean, sd = case_given_choice(posterior, choice_number(discordant, fn.members), kind)
            deviation = auxiliary - about.mean[rest] - mean[rest]
            numpyro.factor(f"{name}_auxiliary_density", norm.logpdf(deviation, 0.0, sd[rest]))
        return records

    def _auxiliary_cases(self, name: str, fn: RepeatsOfCases) -> Float[Array, "rest cases"]:
        rest, about = self.rest, fn.about
        estimate = Gaussian(self.estimates.middle[rest], 1.0 / self.variance[rest])
        z = sample_coordinates(f"{name}_auxiliary_z", estimate.value.shape)
        remainder = jnp.where(self.estimates.apart, about.apart_widening, 1.0) * about.remainder
        cases = reparameterise(z, estimate, about.mean[rest], remainder[rest])
        numpyro.factor(f"{name}_auxiliary_volume", cases.log_volume)
        return cases.value


class DrawnReparam(Reparam):
    """Standard normals that nothing observed depends on: drawn where a draw is wanted, else zero.

    The sampler has then no dimensions for what is known in closed form given the rest.
    """

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        z = standard_normals(f"{name}_drawn", fn.shape())
        return None, jnp.zeros(fn.shape()) if z is None else z
