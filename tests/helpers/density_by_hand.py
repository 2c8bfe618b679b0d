"""The density of the model of records as the documentation has it, written in numpy and SciPy alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from helpers.repeats_by_hand import Numbers, by_hand
from scipy import stats

from bayes_tyre.inference.model.default_priors import APART_WEIGHT, APART_WIDENING, PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import APART_REPEATS, APART_SPARE_CASES
from bayes_tyre.inference.record_data import RecordData

PARAMETERS = ("k", "beta")
Values = Mapping[str, np.ndarray]


def log_density(values: Values, data: RecordData, factors: Factors, repeats: str, noise: str) -> float:
    """Return the log density of all that the model samples, and of the forces.

    Parameters
    ----------
    values:
        By name: hyperparameters, and `log_sd_repeat_by_speed`, `terms`, `log_cases`, `log_records`,
        `log_sigma_typical`, `log_sigma_records`, `atanh_rho_typical`, `atanh_rho_records`, `offsets_of_records` as
        far as there are any.
    data, factors:
        The records and how they group.
    repeats, noise:
        How repeats scatter, and whether noise is autoregressive or a Student-t.
    """
    total = sum(PRIORS[name].scipy().logpdf(values[name]) for name in PRIORS if name in values and above(name))
    total += _terms(values, factors) + _levels(values, factors)
    scatter = np.stack([scatter_of(name, values, factors) for name in PARAMETERS])
    if factors.speed.varies:
        for i, name in enumerate(PARAMETERS):
            typical, spread = values[f"sd_log_{name}_repeat"], values[f"sd_log_{name}_repeat_over_speeds"]
            total += stats.norm.logpdf(values["log_sd_repeat_by_speed"][i], np.log(typical), spread).sum()
    total += _repeats(values, factors, scatter, repeats)
    for name in ("log_sigma", "atanh_rho"):
        if f"{name}_typical" in values:
            prior = PRIORS["sigma_typical" if name == "log_sigma" else "atanh_rho_typical"]
            total += stats.norm.logpdf(values[f"{name}_typical"], *prior.parameters)
        if f"{name}_records" in values:
            total += stats.norm.logpdf(values[f"{name}_records"], values[f"{name}_typical"], values[f"sd_{name}"]).sum()
    total += stats.norm.logpdf(values["J_group"], *PRIORS["J_group"].parameters).sum()
    return float(total + _forces(values, data, factors, noise))


def log_density_of_print(values: Values, log_printed: np.ndarray, factors: Factors) -> float:
    """Return the log density of all that the model of printed means samples, and of these, shape (parameters, cases).

    Values are named as those of `log_density` are, with `log_sd_published_by_speed`.
    """
    total = sum(PRIORS[name].scipy().logpdf(values[name]) for name in PRIORS if name in values and above(name))
    total += _terms(values, factors)
    for i, name in enumerate(PARAMETERS):
        typical, spread = values[f"sd_log_{name}_published"], values[f"sd_log_{name}_published_over_speeds"]
        by_speed = values["log_sd_published_by_speed"][i]
        total += stats.norm.logpdf(by_speed, np.log(typical), spread).sum()
        scatter = np.exp(by_speed)[factors.speed.of_case]
        off = log_printed[i] - case_means(values, factors)[i]
        total += stats.t.logpdf(off / scatter, values["student_nu"]).sum() - np.log(scatter).sum()
    return float(total)


def above(name: str) -> bool:
    """Whether a prior is of a scalar of its own: group means are terms, typical noise is normal on its own axis."""
    return not name.endswith(("_group", "_typical"))


def case_means(values: Values, factors: Factors) -> np.ndarray:
    """Return the linear predictor, shape (parameters, cases)."""
    ends = np.cumsum([factors.design(name).shape[1] for name in PARAMETERS])[:-1]
    each = zip(PARAMETERS, np.split(values["terms"], ends), strict=True)
    return np.stack([factors.design(name) @ terms for name, terms in each])


def scatter_of(name: str, values: Values, factors: Factors) -> np.ndarray:
    """Return the standard deviation of repeats in each case."""
    if not factors.speed.varies:
        return np.full(len(factors.cases), values[f"sd_log_{name}_repeat"])
    return np.exp(values["log_sd_repeat_by_speed"])[PARAMETERS.index(name), factors.speed.of_case]


def can_stand_apart(factors: Factors) -> bool:
    """Return whether the model has cases that stand apart."""
    ranks = (np.linalg.matrix_rank(factors.design(name)) for name in PARAMETERS)
    return bool(len(factors.cases) - min(ranks) >= APART_SPARE_CASES and factors.repeats.max() >= APART_REPEATS)


def numbers_of(values: Values, factors: Factors) -> Numbers:
    """Return what the density of the repeats of cases takes."""
    scatter = np.stack([scatter_of(name, values, factors) for name in PARAMETERS])
    remainder = np.array([[values.get(f"sd_log_{name}_case", 0.0)] for name in PARAMETERS])
    weight, apart = np.asarray(values.get("discordant_weight", 0.0)), APART_WEIGHT * can_stand_apart(factors)
    records = values["log_records"] - offsets(values, factors)
    return Numbers(records, case_means(values, factors), scatter, remainder, weight, apart)


def _terms(values: Values, factors: Factors) -> float:
    total, start = 0.0, 0
    for name in PARAMETERS:
        groups = len(factors.group.labels)
        total += stats.norm.logpdf(values["terms"][start : start + groups], *PRIORS[f"{name}_group"].parameters).sum()
        start += groups
        for effect, factor in factors.effects(name).items():
            coordinates = values["terms"][start : start + factor.basis.shape[1]]
            total += stats.norm.logpdf(coordinates, 0.0, values[f"sd_log_{name}_{effect}"]).sum()
            start += len(coordinates)
    return float(total)


def offsets(values: Values, factors: Factors) -> np.ndarray:
    """Return what specimen, day and covariates add to the logarithms of each record's values."""
    total, levels = np.zeros(values["log_records"].shape), factors.levels
    for record, i in np.ndindex(*total.shape):
        for name, level in levels.groupings.items():
            total[record, i] += values[f"log_{name}"][i, level.of_record[record]]
        if levels.covariates is not None:
            total[record, i] += float(levels.covariates.values[record] @ values["log_covariate"][i])
    return total


def _levels(values: Values, factors: Factors) -> float:
    total = 0.0
    for i, parameter in enumerate(PARAMETERS):
        for name in factors.levels.groupings:
            total += stats.norm.logpdf(values[f"log_{name}"][i], 0.0, values[f"sd_log_{parameter}_{name}"]).sum()
        if factors.levels.covariates is not None:
            prior = PRIORS[f"log_{parameter}_covariate"].parameters
            total += stats.norm.logpdf(values["log_covariate"][i], *prior).sum()
    return float(total)


def _repeats(values: Values, factors: Factors, scatter: np.ndarray, repeats: str) -> float:
    records, of_record = values["log_records"] - offsets(values, factors), factors.of_record
    if repeats == "mixture" or (repeats == "normal" and can_stand_apart(factors)):
        numbers = numbers_of(values, factors)
        each = (by_hand(numbers, factors, case) for case in range(len(factors.cases)))
        return float(sum(np.logaddexp.reduce(list(joint.values())) for joint in each))
    cases, total = case_means(values, factors), 0.0
    rest = [i for i, name in enumerate(PARAMETERS) if f"sd_log_{name}_case" in values]
    if rest:
        own = values["log_cases"].reshape(len(rest), -1)
        sd = np.array([[values[f"sd_log_{PARAMETERS[i]}_case"]] for i in rest])
        usual, apart = (stats.norm.pdf(own - cases[rest], 0.0, wider * sd) for wider in (1.0, APART_WIDENING))
        weight = APART_WEIGHT * can_stand_apart(factors)
        total += np.log((1.0 - weight) * usual + weight * apart).sum()
        cases[rest] = own
    deviation, sd = records - cases.T[of_record], scatter.T[of_record]
    if repeats == "normal":
        return float(total + stats.norm.logpdf(deviation, 0.0, sd).sum())
    t: Any = stats.multivariate_t  # SciPy's stubs say int, of shape and df
    each = zip(deviation, sd, strict=True)
    return float(total + sum(t.logpdf(d, shape=np.diag(s**2), df=values["student_nu"]) for d, s in each))


def _forces(values: Values, data: RecordData, factors: Factors, noise: str) -> float:
    """Return the log density of the forces: normal, for they are linear in F_i and J, which are.

    With Student-t noise, of F_i and J too, which are then among the values.
    """
    total = 0.0
    for r in range(len(values["log_records"])):
        present = np.asarray(data.present[r])
        u, F = np.asarray(data.u[r])[present], np.asarray(data.F[r])[present]
        log_k, log_beta = values["log_records"][r]
        g = 1.0 - np.exp(-np.abs(u) / np.exp(log_beta))
        sigma = np.exp(values["log_sigma_records"][r] if "log_sigma_records" in values else values["log_sigma_typical"])
        if noise == "student":
            scale = np.array([data.span[r], values["sd_J"]])
            total += stats.norm.logpdf(values["offsets_of_records"][r], 0.0, scale).sum()
            F_i, J = values["offsets_of_records"][r] + [
                data.F_0[r],
                values["J_group"][factors.group.of_case[factors.of_record[r]]],
            ]
            mean = F_i + (J + np.exp(log_k) * u) * g
            total += stats.t.logpdf(F, values["noise_nu"], mean, sigma).sum()
            continue
        rho = 0.0
        if noise == "ar1":
            rho = np.tanh(
                values["atanh_rho_records"][r] if "atanh_rho_records" in values else values["atanh_rho_typical"]
            )
        lag = np.abs(np.subtract.outer(np.arange(len(u)), np.arange(len(u))))
        covariance: Any = sigma**2 * rho**lag  # SciPy's stubs say int, of all its shapes
        covariance += np.asarray(data.span[r]) ** 2 + values["sd_J"] ** 2 * np.outer(g, g)
        J = values["J_group"][factors.group.of_case[factors.of_record[r]]]
        mean = np.asarray(data.F_0[r]) + J * g + np.exp(log_k) * u * g
        total += stats.multivariate_normal.logpdf(F, mean, covariance)
    return float(total)
