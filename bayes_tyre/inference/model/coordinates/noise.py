"""Coordinates of the noise of records; and of their offsets, where heavy tails of the noise leave these open."""

from collections.abc import Callable
from typing import Any, override

import jax.numpy as jnp
import numpyro
from jaxtyping import Array
from numpyro.infer.reparam import Reparam

from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian
from bayes_tyre.inference.model.coordinates.reparams import Coordinates, NormalReparam, sample_coordinates
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import Hyperparameters
from bayes_tyre.inference.model.likelihood.offsets import OffsetsPosterior
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood


def noise_coordinates(name: str, estimate: Callable[[Hyperparameters], Gaussian]) -> Coordinates:
    """Return the coordinates of a noise parameter of each record, and of its typical value.

    The typical value follows its records' estimates too: the larger their standard deviation, the less they determine
    it, and a step size made for the narrow part of that funnel diverges in the wide part.
    """

    def typical(values: Hyperparameters) -> Reparam:
        of_records = estimate(values)
        if of_records.value.shape == (1,):
            return NormalReparam(Gaussian(of_records.value[0], of_records.precision[0]))
        weight = 1.0 / (values[f"sd_{name}"] ** 2 + 1.0 / of_records.precision)
        total = jnp.sum(weight)
        return NormalReparam(Gaussian(jnp.sum(weight * of_records.value) / total, total))

    return {f"{name}_typical": typical, f"{name}_records": lambda values: NormalReparam(estimate(values))}


def student_coordinates(estimates: RecordEstimates, factors: Factors, likelihood: StudentLikelihood) -> Coordinates:
    """Return the coordinates of what Student-t noise changes: the offsets of records, and their sigma."""
    group = factors.group.of_case[factors.of_record]

    def offsets(values: Hyperparameters) -> Reparam:
        mean_J = values["J_group"][group]
        noise = values["sigma"], values["noise_nu"]
        return OffsetsReparam(likelihood.offsets_given(values["log_records"], *noise, mean_J, values["sd_J"]))

    def log_sigma(values: Hyperparameters) -> Gaussian:
        nu = values["noise_nu"]
        return Gaussian(estimates.log_sigma, 2.0 * estimates.points * nu / (nu + 3.0))

    return {"offsets_of_records": offsets, **noise_coordinates("log_sigma", log_sigma)}


class OffsetsReparam(Reparam):
    """The offsets of records, in coordinates that follow where they are given all else.

    Parameters
    ----------
    given:
        About where they are, of the prior that the site has.
    """

    def __init__(self, given: OffsetsPosterior) -> None:
        self.given = given

    @override
    def __call__(self, name: str, fn: Any, obs: Any) -> tuple[None, Array]:
        z = sample_coordinates(f"{name}_z", fn.shape())
        numpyro.factor(f"{name}_density", self.given.log_prior_of_drawn(z))
        return None, self.given.draw(z)
