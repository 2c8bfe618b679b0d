"""How far a prior of a group is off the records, whatever the posterior makes of the two.

A narrow prior that is wrong hardly moves: what the records say otherwise goes into the effects, the remainders of cases
and the repeats, whose standard deviations grow with it. Neither the shift of the posterior nor its width then says how
wrong the prior is. Here the means of groups are free, and all standard deviations are drawn from their own priors and
weighed by what the values of the records have to say of them.

Source: Evans and Moshonov (2006), "Checking for prior-data conflict": the prior is held against what data alone say.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float
from scipy import stats

from bayes_tyre.inference.diagnostics.course_checks import factors_of_records
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import effect_scales
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import COVARIATE, LEVELS
from bayes_tyre.inference.sampling.datatree import draws_in_a_row

#: Draws of the standard deviations, fewer of many cases: each takes a matrix of their number squared.
_DRAWS, _NUMBERS = 2000, 10_000_000
#: Least probability that has a number of standard errors.
_LEAST = 1e-300


def standard_errors_off(posterior: xr.Dataset, parameter: str, priors: Priors) -> Float[np.ndarray, " groups"]:
    """Return how far the records are off the prior of each group, in standard errors of both together.

    Records are taken with what the posterior has for them, which a record that says little draws to the prior: it then
    contradicts nothing.

    Parameters
    ----------
    posterior:
        Dims chain, draw, record; for displacement and force as they were measured.
    parameter, priors:
        Such as ``k``, whose ``k_group`` has a log-normal prior.
    """
    log_weight, of_group, variance = _means_of_groups(posterior, parameter, priors)
    middle, sd = priors[f"{parameter}_group"].parameters
    two_sided = 2.0 * stats.norm.sf(np.abs(of_group - middle) / np.sqrt(variance + sd**2))
    probability = np.average(two_sided, axis=0, weights=np.exp(log_weight - log_weight.max()))
    return stats.norm.isf(np.maximum(probability, _LEAST) / 2.0)


class _Means(NamedTuple):
    """Means of the groups' logarithms and their variances given a draw of the scales, and its log weight."""

    log_weight: Float[np.ndarray, " draws"]
    of_group: Float[np.ndarray, "draws groups"]
    variance: Float[np.ndarray, "draws groups"]


def _means_of_groups(posterior: xr.Dataset, parameter: str, priors: Priors) -> _Means:
    factors = factors_of_records(posterior)
    values = np.log(draws_in_a_row(posterior[parameter]))
    mean, variance = values.mean(axis=0), values.var(axis=0)
    repeats, case = factors.repeats, factors.of_record
    of_case, noise = (np.bincount(case, each) / repeats for each in (mean, variance))
    within = np.bincount(case, (mean - of_case[case]) ** 2)
    columns, names = _columns(posterior, factors, parameter)
    drawn = _Scales(priors, max(1, min(_DRAWS, _NUMBERS // len(repeats) ** 2)))
    between = np.stack([drawn(name) for name in names], axis=1) if names else np.zeros((drawn.draws, 0))
    remainder = drawn(f"sd_log_{parameter}_case") if factors.has_remainder(parameter) else np.zeros(drawn.draws)
    of_repeat = drawn.of_repeats(parameter, factors) ** 2 + noise
    covariance = (columns * between[:, None] ** 2) @ columns.T
    covariance += (remainder[:, None] ** 2 + of_repeat / repeats)[:, :, None] * np.eye(len(repeats))
    groups = np.eye(len(factors.group.labels))[factors.group.of_case]
    means = _generalised_least_squares(groups, of_case, covariance)
    of_scatter = np.sum((repeats - 1) * np.log(of_repeat) + within / of_repeat, axis=1)
    return means._replace(log_weight=means.log_weight - 0.5 * of_scatter)


def _generalised_least_squares(
    design: Float[np.ndarray, "cases groups"],
    values: Float[np.ndarray, " cases"],
    covariance: Float[np.ndarray, "draws cases cases"],
) -> _Means:
    """Return the coefficients under each covariance; the log weight is the density with them integrated out."""
    lower = np.linalg.cholesky(covariance)
    columns = np.broadcast_to(np.column_stack([design, values]), (len(lower), len(values), design.shape[1] + 1))
    white = np.linalg.solve(lower, columns)
    basis, upper = np.linalg.qr(white[:, :, :-1])
    part = np.einsum("dcg,dc->dg", basis, white[:, :, -1])
    inverse = np.linalg.inv(upper)
    log_volume = sum(np.log(np.abs(np.diagonal(each, 0, 1, 2))).sum(axis=1) for each in (lower, upper))
    square = np.sum(white[:, :, -1] ** 2, axis=1) - np.sum(part**2, axis=1)
    return _Means(-log_volume - 0.5 * square, np.einsum("dgh,dh->dg", inverse, part), np.sum(inverse**2, axis=2))


def _columns(
    posterior: xr.Dataset, factors: Factors, parameter: str
) -> tuple[Float[np.ndarray, "cases columns"], list[str]]:
    """Return what each coordinate of the effects adds to a case, and the name of what it is distributed by."""
    scales = zip(factors.effects(parameter).values(), effect_scales(parameter, factors), strict=True)
    parts = [(factor.matrix, scale) for factor, scale in scales]
    average = np.eye(len(factors.cases))[factors.of_record].T / factors.repeats[:, None]
    for level in LEVELS:
        if f"record_{level}" in posterior.coords:
            labels = posterior[f"record_{level}"].to_numpy()
            parts.append((average @ np.equal.outer(labels, np.unique(labels)), f"sd_log_{parameter}_{level}"))
    if f"record_{COVARIATE}" in posterior.coords:
        values = posterior[f"record_{COVARIATE}"].transpose("record", COVARIATE).to_numpy()
        parts.append((average @ values, f"log_{parameter}_{COVARIATE}"))
    names = [name for matrix, name in parts for _ in range(matrix.shape[1])]
    return np.concatenate([np.zeros((len(factors.cases), 0)), *(matrix for matrix, _ in parts)], axis=1), names


class _Scales:
    """Draws of standard deviations from their priors; of a slope's, its prior's own."""

    def __init__(self, priors: Priors, draws: int) -> None:
        self.priors, self.draws, self.rng = priors, draws, np.random.default_rng(0)
        self.drawn: dict[str, Float[np.ndarray, " draws"]] = {}

    def __call__(self, name: str) -> Float[np.ndarray, " draws"]:
        """Return the draws of this name, the same whenever it is asked for."""
        if name not in self.drawn:
            prior = self.priors[name]
            self.drawn[name] = (
                np.full(self.draws, prior.parameters[1])
                if name.endswith(COVARIATE)
                else prior.scipy().rvs(self.draws, random_state=self.rng)
            )
        return self.drawn[name]

    def of_repeats(self, parameter: str, factors: Factors) -> Float[np.ndarray, "draws cases"]:
        """Return that of the repeats about each case, which differs by speed where speed varies."""
        typical = self(f"sd_log_{parameter}_repeat")[:, None]
        if not factors.speed.varies:
            return np.repeat(typical, len(factors.cases), axis=1)
        over = self(f"sd_log_{parameter}_repeat_over_speeds")[:, None]
        by_speed = typical * np.exp(over * self.rng.standard_normal((self.draws, len(factors.speed.labels))))
        return by_speed[:, factors.speed.of_case]
