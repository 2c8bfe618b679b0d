"""Which coordinates each site of the models is sampled in, given estimates from the data.

Estimates, by least squares and Fisher information, shape the coordinates only, never the posterior.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import biject_to
from numpyro.infer.reparam import Reparam

from bayes_tyre.inference.model.case_effects import OFFSET, case_remainder, sd_about_cases, with_remainder
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, RecordEstimates
from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates, find_kinds
from bayes_tyre.inference.model.coordinates.noise import noise_coordinates, student_coordinates
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian, Reparameterised, reparameterise_by_slope
from bayes_tyre.inference.model.coordinates.reparams import (
    CasesReparam,
    Coordinates,
    DrawnReparam,
    InCoordinates,
    NormalReparam,
    RecordsReparam,
    Reparameterisation,
    TermsReparam,
    softplus,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, Hyperparameters, by_family, family_of, prior_sites
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood
from bayes_tyre.inference.model.models import log_published, published_model, records_model
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import COVARIATE, RecordLevels
from bayes_tyre.inference.model.terms import find_terms

#: Most terms of a linear predictor that are reparameterised together: time goes with the cube of their number.
MOST_TOGETHER = 64
#: Repeats that a case without any counts as in its coordinates: an estimate without weight.
_ALMOST_NONE = 1e-6
#: Scatter of printed means where they fit exactly.
_LEAST_SD = 0.01


def records_in_coordinates(approximation: LaplaceApproximation, **arguments: Any) -> None:
    """Run `records_model`, with these arguments, in coordinates that follow the records' Laplace approximation."""
    coordinates = record_coordinates(approximation, arguments["factors"], arguments.get("priors", PRIORS))
    if isinstance(likelihood := arguments.get("likelihood"), StudentLikelihood):
        coordinates = {**coordinates, **student_coordinates(approximation.records, arguments["factors"], likelihood)}
    InCoordinates(records_model, coordinates)(**arguments)


def published_in_coordinates(**arguments: Any) -> None:
    """Run `published_model`, with these arguments, in coordinates that follow what is printed."""
    InCoordinates(published_model, published_coordinates(**arguments))(**arguments)


def hyperparameter_starts(
    sites: Iterable[str], values: Mapping[str, np.ndarray], priors: Priors = PRIORS
) -> dict[str, np.ndarray]:
    """Return values by name of the prior as unconstrained starts of the sites that sample them."""
    starts = {}
    for site, names in by_family(sites, priors).items():
        fn, value = family_of(names, priors), np.stack([values[name] for name in names])
        if isinstance(fn, dist.HalfNormal):
            starts[f"{site}_base"] = np.asarray(softplus(fn).inv(value))
        else:
            starts[site] = np.asarray(biject_to(fn.support).inv(value))
    return starts


def record_starts(arguments: Mapping[str, Any], estimates: RecordEstimates | None = None) -> dict[str, np.ndarray]:
    """Return where the hyperparameters of records start: their medians, and where estimates say more, these.

    Parameters
    ----------
    arguments:
        As `records_model` has them.
    estimates:
        Of the records; None: not known yet.
    """
    priors = arguments["priors"]
    values = priors.medians()
    if estimates is not None:
        values["sd_J"] = np.asarray(estimates.typical_J(arguments["factors"])[1])
    sites = prior_sites(arguments["factors"], arguments["repeats"], arguments["noise"])
    return hyperparameter_starts(sites, values, priors)


def case_coordinates(
    factors: Factors,
    estimates: CaseEstimates,
    reparameterisation_of: Callable[[Hyperparameters], Reparameterisation],
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> Coordinates:
    """Return the coordinates of everything from the records' logarithms upwards.

    Parameters
    ----------
    factors, estimates:
        Cases, and their estimates from the records.
    reparameterisation_of:
        Gives the reparameterisation of the records' logarithms.
    parameters, priors:
        As the model has them.
    """
    terms, rest = find_terms(factors, parameters, priors), with_remainder(factors, parameters)
    repeats = jnp.asarray(np.maximum(factors.repeats, _ALMOST_NONE))

    def variance(values: Hyperparameters) -> Float[Array, "parameters cases"]:
        return (sd_about_cases(factors, values, parameters) ** 2 + estimates.variance) / repeats

    def middle(values: Hyperparameters) -> Float[Array, "parameters cases"]:
        if OFFSET not in values:
            return estimates.middle
        total = jnp.zeros(estimates.middle.shape).at[:, factors.of_record].add(values[OFFSET].T)
        return estimates.middle - total / repeats

    kinds = find_kinds(terms.design, factors)
    wider = jnp.where(estimates.apart, priors.apart_widening, 1.0)

    def of_terms(values: Hyperparameters) -> Reparam:
        of_cases = variance(values) + (wider * case_remainder(factors, values, parameters)) ** 2
        if terms.design.shape[2] > MOST_TOGETHER:
            return NormalReparam(Gaussian(*map(terms.flat, kinds.each_alone(estimates.terms, of_cases))))
        return TermsReparam(terms, kinds.estimate(middle(values), of_cases))

    return {
        "log_sd_repeat_by_speed": lambda _: NormalReparam(estimates.log_sd_repeat),
        "terms": of_terms,
        "log_cases": lambda values: CasesReparam(
            Gaussian(*(of[rest].reshape(-1, 1) for of in (middle(values), 1.0 / variance(values)))),
            wider[rest].reshape(-1, 1),
        ),
        "log_records": lambda values: RecordsReparam(
            reparameterisation_of(values), estimates._replace(middle=middle(values)), variance(values), rest
        ),
        "choice_z": lambda _: DrawnReparam(),
        "kind_z": lambda _: DrawnReparam(),
        "case_z": lambda _: DrawnReparam(),
    }


def record_coordinates(approximation: LaplaceApproximation, factors: Factors, priors: Priors = PRIORS) -> Coordinates:
    """Return the coordinates of `bayes_tyre.inference.model.models.records_model`."""
    estimates, group = approximation.records, factors.group.of_case[factors.of_record]

    def of_mean_J(values: Hyperparameters) -> Reparam:
        weight = 1.0 / (values["sd_J"] ** 2 + estimates.J_variance)
        total, sums = (
            jnp.zeros(len(factors.group.labels)).at[group].add(each)
            for each in (weight, weight * estimates.centre[:, 1])
        )
        return NormalReparam(Gaussian(sums / total, total))

    def reparameterisation_of(values: Hyperparameters) -> Reparameterisation:
        quadratic = estimates.of_log_values(values["J_group"][group], values["sd_J"])

        def reparameterised(z: Array, case: Array, sd_repeat: Array) -> Reparameterised:
            return reparameterise_by_slope(z, quadratic.slope_at(case), quadratic.precision, case, sd_repeat)

        return reparameterised

    def atanh_rho(_: Hyperparameters) -> Gaussian:
        return Gaussian(jnp.arctanh(estimates.rho), estimates.points * (1.0 - estimates.rho**2))

    def log_sigma(values: Hyperparameters) -> Gaussian:
        value = estimates.log_sigma
        if "rho" in values:
            # The innovations are determined whatever rho is, so sigma follows rho.
            value = value + 0.5 * (jnp.log1p(-(estimates.rho**2)) - jnp.log1p(-(values["rho"] ** 2)))
        return Gaussian(value, 2.0 * estimates.points)

    def of_records(values: Hyperparameters) -> Gaussian:
        """Return what the records' estimates have beside their case's; of discordant ones next to nothing."""
        off = estimates.centre[:, 2:] - approximation.cases.middle.T[factors.of_record]
        variance = (sd_about_cases(factors, values) ** 2 + approximation.cases.variance).T[factors.of_record]
        weight = jnp.where(approximation.cases.discordant[:, None], _ALMOST_NONE, 1.0)
        return Gaussian(off, weight / variance)

    return {
        **case_coordinates(factors, approximation.cases, reparameterisation_of, priors=priors),
        **_level_coordinates(factors.levels, of_records),
        "J_group": of_mean_J,
        "offsets_z": lambda _: DrawnReparam(),
        **noise_coordinates("atanh_rho", atanh_rho),
        **noise_coordinates("log_sigma", log_sigma),
    }


def _level_coordinates(levels: RecordLevels, of_records: Callable[[Hyperparameters], Gaussian]) -> Coordinates:
    """Return the coordinates of effects of specimens and days, and of slopes on covariates, each as if alone."""
    columns = {name: np.eye(len(level.labels))[level.of_record] for name, level in levels.groupings.items()}
    if levels.covariates is not None:
        columns[COVARIATE] = levels.covariates.values

    def of_effects(column: Float[np.ndarray, "records levels"]) -> Callable[[Hyperparameters], Reparam]:
        def coordinates(values: Hyperparameters) -> Reparam:
            estimate = of_records(values)
            precision = estimate.precision.T @ column**2 + _ALMOST_NONE
            return NormalReparam(Gaussian((estimate.precision * estimate.value).T @ column / precision, precision))

        return coordinates

    return {f"log_{name}": of_effects(column) for name, column in columns.items()}


def published_coordinates(
    values: Mapping[str, Float[ArrayLike, " cases"]], factors: Factors, priors: Priors = PRIORS
) -> Coordinates:
    """Return the coordinates of `bayes_tyre.inference.model.models.published_model`."""
    terms, printed = find_terms(factors, PARAMETERS, priors), log_published(values)
    kinds = find_kinds(terms.design, factors)

    def of_terms(hyperparameters: Hyperparameters) -> Reparam:
        return TermsReparam(
            terms, kinds.estimate(printed, sd_about_cases(factors, hyperparameters, of="published") ** 2)
        )

    log_sd_published = _log_sd_of_residuals(printed, terms.design, factors)
    return {"log_sd_published_by_speed": lambda _: NormalReparam(log_sd_published), "terms": of_terms}


def _log_sd_of_residuals(
    printed: Float[Array, "parameters cases"], design: Float[np.ndarray, "parameters cases most"], factors: Factors
) -> Gaussian:
    """Return estimates by speed of the logarithm of what least squares leave, of as many means as are spare."""
    cut = max(design.shape[1:]) * np.finfo(float).eps  # as `matrix_rank` has it
    rest = jnp.stack([y - x @ (np.linalg.pinv(x, rtol=cut) @ y) for y, x in zip(printed, design, strict=True)])
    at_speed = factors.speed.of_case[:, None] == np.arange(len(factors.speed.labels))
    spare = np.array([1.0 - np.linalg.matrix_rank(x) / len(x) for x in design])[:, None] * at_speed.sum(axis=0)
    variance = (rest**2 @ at_speed + _LEAST_SD**2) / np.maximum(spare, _ALMOST_NONE)
    estimate = jnp.where(spare > _ALMOST_NONE, 0.5 * jnp.log(variance), np.log(_LEAST_SD))
    return Gaussian(estimate, jnp.asarray(2.0 * spare))
