"""What calibration ranks beside the parameters: log densities, and the ratios of two configurations.

Source: Modrak et al. (2023), "Simulation-based calibration checking for Bayesian computation: the choice of test
quantities shapes sensitivity": ranks of parameters alone do not show all that can be wrong, and ranks of log densities,
which depend on the data too, do. Each is written out here once more, apart from the program that is sampled.
"""

import numpy as np
from jaxtyping import Float
from scipy.special import expit
from scipy.stats import norm

from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, prior_sites
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.studies.design import Design
from bayes_tyre.studies.truths import Truths, noiseless_forces

#: The log density of the forces of one record.
OF_RECORD = "log_likelihood_of_record"


def with_derived(
    factors: Factors, model: ModelSettings, values: Truths, of_record: Float[np.ndarray, "*sets records"]
) -> Truths:
    """Return truths or draws, shape (sets, ...) each, with what is ranked beside them.

    Parameters
    ----------
    factors, model:
        Of the records, and the options that they are fitted with.
    values:
        By name.
    of_record:
        Log density of the forces of each record at these.
    """
    derived: Truths = {OF_RECORD: of_record, "log_likelihood": of_record.sum(axis=-1)}
    derived["log_prior"] = log_prior(prior_sites(factors, model.repeats, model.correlation), values, model.priors)
    if "student_nu" not in values:
        derived["log_repeats"] = log_repeats(factors, values, model.priors.discordant_widening)
    return {**values, **derived, **configuration_ratios(factors, values)}


def log_likelihood_of_records(
    design: Design, values: Truths, force_kN: Float[np.ndarray, "*#sets records points"]
) -> Float[np.ndarray, "*sets records"]:
    """Return the log density of the forces of each record of a design at truths or draws, shape (sets, ...) each."""
    z = (force_kN - noiseless_forces(design, values)) / values["sigma"][..., None]
    log_density = norm.logpdf(z[..., 0])
    rho = values.get("rho", np.zeros(values["sigma"].shape))[..., None]
    new = (z[..., 1:] - rho * z[..., :-1]) / np.sqrt(1.0 - rho**2)
    log_density = log_density + (norm.logpdf(new) - 0.5 * np.log1p(-(rho**2))).sum(axis=-1)
    return log_density - z.shape[-1] * np.log(values["sigma"])


def log_prior(sites: tuple[str, ...], values: Truths, priors: Priors) -> Float[np.ndarray, "..."]:
    """Return the joint log density of the hyperparameters, those spread on a logarithm per unit of that."""
    total = np.zeros(values["sd_J"].shape)
    for site in sites:
        density = priors[site].scipy().logpdf(values[site])
        if priors[site].of_logarithm:
            density = density + np.log(values[site])
        total = total + density.reshape(*total.shape, -1).sum(axis=-1)
    return total


def log_repeats(factors: Factors, values: Truths, widening: float) -> Float[np.ndarray, "..."]:
    """Return the log density of log k and log beta of all records about their cases, at truths or draws.

    As `bayes_tyre.inference.model.repeat_distribution` has its normal and its mixture.
    """
    if "discordant_weight" not in values:
        return _log_about_case(factors, values, 1.0).sum(axis=-1)
    return np.logaddexp(*_log_each(factors, values, widening)).sum(axis=-1)


def discordance_probability(factors: Factors, values: Truths, widening: float) -> Float[np.ndarray, "*sets records"]:
    """Return the probability that each record is discordant, given its own k and beta and its case's."""
    usual, discordant = _log_each(factors, values, widening)
    return expit(discordant - usual)


def _log_each(factors: Factors, values: Truths, widening: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the log densities of usual and of discordant repeats, shape (..., records)."""
    weight = values["discordant_weight"][..., None]
    usual, discordant = (_log_about_case(factors, values, wider) for wider in (1.0, widening))
    return np.log1p(-weight) + usual, np.log(weight) + discordant


def _log_about_case(factors: Factors, values: Truths, wider: float) -> np.ndarray:
    log_density = np.zeros(values["k"].shape)
    for parameter in PARAMETERS:
        off = np.log(values[parameter] / centre_of_records(factors, parameter, values))
        log_density += norm.logpdf(off, 0.0, wider * scatter_of_records(factors, parameter, values))
    return log_density


def centre_of_records(factors: Factors, parameter: str, values: Truths) -> Float[np.ndarray, "*sets records"]:
    """Return what the k or beta of each record scatters about: its case's, moved by its specimen, day, covariates."""
    case = values[f"{parameter}_case"][..., factors.of_record]
    if not factors.levels.names:
        return case
    return case * np.exp(factors.levels.offset(lambda name: values[f"log_{parameter}_{name}"]))


def scatter_of_records(factors: Factors, parameter: str, values: Truths) -> Float[np.ndarray, "*sets #records"]:
    """Return the standard deviation of usual repeats about their case, relative, of each record."""
    if factors.speed.varies:
        return values[f"sd_log_{parameter}_repeat_by_speed"][..., factors.speed.of_case[factors.of_record]]
    return values[f"sd_log_{parameter}_repeat"][..., None]


def configuration_ratios(factors: Factors, values: Truths) -> Truths:
    """Return the mean ratio of k and of beta of two configurations over the cases that match; none of other numbers."""
    found: dict[str, dict[tuple[str, ...], int]] = {}
    for number, case in enumerate(factors.cases):
        found.setdefault(case.configuration, {})[tuple(map(str, case[1:]))] = number
    if len(found) != 2:
        return {}
    one, other = (found[name] for name in sorted(found))
    matched = [words for words in one if words in other]
    first, second = ([each[words] for words in matched] for each in (one, other))
    if not matched:
        return {}
    logs = {parameter: np.log(values[f"{parameter}_case"]) for parameter in PARAMETERS}
    return {f"{name}_ratio": np.exp((log[..., first] - log[..., second]).mean(axis=-1)) for name, log in logs.items()}
