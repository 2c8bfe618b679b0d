"""What calibration ranks beside the parameters: log densities, and the ratios of two configurations.

Source: Modrak et al. (2023), "Simulation-based calibration checking for Bayesian computation: the choice of test
quantities shapes sensitivity": ranks of parameters alone do not show all that can be wrong, and ranks of log densities,
which depend on the data too, do. Each is written out here once more, apart from the program that is sampled.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import expit
from scipy.stats import norm, t

from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.studies.design import Design
from bayes_tyre.studies.truths import Truths, noiseless_forces

#: The log density of the forces of one record.
OF_RECORD = "log_likelihood_of_record"


class Hierarchy(NamedTuple):
    """What is above the records.

    Attributes
    ----------
    factors:
        How they group into cases, and these.
    priors, sites:
        Priors, and the names of those that the model has.
    parameters:
        What a case, and a record of it, has values of.
    """

    factors: Factors
    priors: Priors
    sites: Sequence[str]
    parameters: Sequence[str] = PARAMETERS


def with_derived(hierarchy: Hierarchy, values: Truths, of_record: Float[np.ndarray, "*sets records"]) -> Truths:
    """Return truths or draws, shape (sets, ...) each, with what is ranked beside them.

    Parameters
    ----------
    hierarchy:
        Above the records.
    values:
        By name.
    of_record:
        Log density of the readings of each record at these.
    """
    derived: Truths = {OF_RECORD: of_record, "log_likelihood": of_record.sum(axis=-1)}
    derived["log_prior"] = log_prior(hierarchy.sites, values, hierarchy.priors)
    if "student_nu" not in values:
        derived["log_repeats"] = log_repeats(hierarchy, values)
    return {**values, **derived, **configuration_ratios(hierarchy.factors, values)}


def log_likelihood_of_records(
    design: Design, values: Truths, force_kN: Float[np.ndarray, "*#sets records points"]
) -> Float[np.ndarray, "*sets records"]:
    """Return the log density of the forces of each record of a design at truths or draws, shape (sets, ...) each."""
    z = (force_kN - noiseless_forces(design, values)) / values["sigma"][..., None]
    log_volume = z.shape[-1] * np.log(values["sigma"])
    if "noise_nu" in values:
        return t.logpdf(z, values["noise_nu"][..., None, None]).sum(axis=-1) - log_volume
    log_density = norm.logpdf(z[..., 0])
    rho = values.get("rho", np.zeros(values["sigma"].shape))[..., None]
    new = (z[..., 1:] - rho * z[..., :-1]) / np.sqrt(1.0 - rho**2)
    return log_density + (norm.logpdf(new) - 0.5 * np.log1p(-(rho**2))).sum(axis=-1) - log_volume


def log_prior(sites: Sequence[str], values: Truths, priors: Priors) -> Float[np.ndarray, "..."]:
    """Return the joint log density of the hyperparameters, those spread on a logarithm per unit of that."""
    total = np.zeros(())
    for site in sites:
        density = priors[site].scipy().logpdf(values[site])
        if priors[site].of_logarithm:
            density = density + np.log(values[site])
        scalar = QUANTITIES[site][0] is None
        total = total + (density if scalar else density.sum(axis=-1))
    return total


def log_repeats(hierarchy: Hierarchy, values: Truths) -> Float[np.ndarray, "..."]:
    """Return the log density of the logarithms of all records' values about their cases', at truths or draws.

    As `bayes_tyre.inference.model.repeat_distribution` has its normal and its mixture.
    """
    if "discordant_weight" not in values:
        return _log_about_case(hierarchy, values, 1.0).sum(axis=-1)
    return np.logaddexp(*_log_each(hierarchy, values)).sum(axis=-1)


def discordance_probability(hierarchy: Hierarchy, values: Truths) -> Float[np.ndarray, "*sets records"]:
    """Return the probability that each record is discordant, given its own values and its case's."""
    usual, discordant = _log_each(hierarchy, values)
    return expit(discordant - usual)


def _log_each(hierarchy: Hierarchy, values: Truths) -> tuple[np.ndarray, np.ndarray]:
    """Return the log densities of usual and of discordant repeats, shape (..., records)."""
    weight = values["discordant_weight"][..., None]
    widening = hierarchy.priors.discordant_widening
    usual, discordant = (_log_about_case(hierarchy, values, wider) for wider in (1.0, widening))
    return np.log1p(-weight) + usual, np.log(weight) + discordant


def _log_about_case(hierarchy: Hierarchy, values: Truths, wider: float) -> np.ndarray:
    log_density = np.zeros(values["k"].shape)
    for parameter in hierarchy.parameters:
        off = np.log(values[parameter] / centre_of_records(hierarchy.factors, parameter, values))
        log_density += norm.logpdf(off, 0.0, wider * sd_of_records(hierarchy.factors, parameter, values))
    return log_density


def centre_of_records(factors: Factors, parameter: str, values: Truths) -> Float[np.ndarray, "*sets records"]:
    """Return what the k or beta of each record scatters about: its case's, moved by its specimen, day, covariates."""
    case = values[f"{parameter}_case"][..., factors.of_record]
    if not factors.levels.names:
        return case
    return case * np.exp(factors.levels.offset(lambda name: values[f"log_{parameter}_{name}"]))


def sd_of_records(factors: Factors, parameter: str, values: Truths) -> Float[np.ndarray, "*sets #records"]:
    """Return the standard deviation of usual repeats about their case, relative, of each record."""
    if factors.speed.varies:
        return values[f"sd_log_{parameter}_repeat_by_speed"][..., factors.speed.of_case[factors.of_record]]
    return values[f"sd_log_{parameter}_repeat"][..., None]


def configuration_ratios(factors: Factors, values: Truths) -> Truths:
    """Return the mean ratio of k and of beta of two configurations over the cases that match; none of other numbers."""
    numbers: dict[str, dict[tuple[str, ...], int]] = {}
    for number, case in enumerate(factors.cases):
        numbers.setdefault(case.configuration, {})[tuple(map(str, case[1:]))] = number
    if len(numbers) != 2:
        return {}
    one, other = (numbers[name] for name in sorted(numbers))
    matched = [factors for factors in one if factors in other]
    first, second = ([each[factors] for factors in matched] for each in (one, other))
    if not matched:
        return {}
    logs = {parameter: np.log(values[f"{parameter}_case"]) for parameter in PARAMETERS}
    return {f"{name}_ratio": np.exp((log[..., first] - log[..., second]).mean(axis=-1)) for name, log in logs.items()}
