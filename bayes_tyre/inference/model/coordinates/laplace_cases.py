"""Estimates of the cases from the Laplace approximation of their records, and of the standard deviation of repeats.

It shapes the coordinates of `coordinates`, and never the posterior.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float
from scipy import stats

from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, apart_weight
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation
from bayes_tyre.inference.model.priors import Priors

#: Scatter of repeats where no case has two of them; it counts with no weight.
_UNKNOWN_SD = 0.1
#: Rounds of reweighted least squares, and the residual below which a case counts no more: far below any scatter.
_ROUNDS, _LEAST_RESIDUAL = 30, 1e-4
#: What is added to the diagonal of normal equations, of its mean: a design may leave terms open.
_RIDGE = 1e-10
#: Cases that cost next to nothing to be taken one by one.
_FEW_CASES = 30


class CaseEstimates(NamedTuple):
    """Estimates of each case's parameters from its records, in the order of `hyperparameters.PARAMETERS`.

    Attributes
    ----------
    middle, variance:
        Shape (parameters, cases): mean of the logarithms of those that look usual, and of the variance of one of them.
    log_sd_repeat:
        Estimates of the logarithm of the scatter of repeats, by speed; shape (parameters, speeds).
    discordant:
        Shape (records,): which records look discordant.
    apart:
        Shape (parameters, cases): which cases look as if they stood apart from the others.
    terms:
        Least squares of each linear predictor's terms (`bayes_tyre.inference.model.terms.Terms`), a row a parameter,
        shorter rows filled up.
    """

    middle: Float[Array, "parameters cases"]
    variance: Float[Array, "parameters cases"]
    log_sd_repeat: Gaussian
    discordant: Bool[Array, " records"]
    apart: Bool[Array, "parameters cases"]
    terms: Float[Array, "parameters most"]


def case_estimates(
    values: Float[np.ndarray, "records parameters"],
    variances: Float[np.ndarray, "records parameters"],
    factors: Factors,
    priors: Priors = PRIORS,
    parameters: Sequence[str] = PARAMETERS,
) -> CaseEstimates:
    """Return estimates of the logarithms of the cases from their records; a discordant repeat moves none."""
    members = [factors.of_record == case for case in range(len(factors.cases))]
    # A case without records has no estimate: any value will do, for it has no weight.
    members = [member if member.any() else np.ones_like(member) for member in members]
    median = np.array([np.median(values[member], axis=0) for member in members])
    variance = np.array([np.mean(variances[member], axis=0) for member in members]).T
    both = zip(values.T, variance, strict=True)
    of_parameters = [_log_sd_repeat([own[member] for member in members], of_one, factors) for own, of_one in both]
    log_sd_repeat = Gaussian(*(jnp.asarray(np.stack(of_each)) for of_each in zip(*of_parameters, strict=True)))
    typical = np.exp(log_sd_repeat.value)[:, factors.speed.of_case[factors.of_record]].T
    discordant = _look_discordant(values - median[factors.of_record], variances, typical, priors)
    usual = [member & ~discordant if (member & ~discordant).any() else member for member in members]
    middle, variance = (np.array([np.mean(of[member], axis=0) for member in usual]).T for of in (values, variances))
    apart = np.zeros(middle.shape, dtype=bool)
    if weight := apart_weight(factors, parameters, priors):
        of_one = np.exp(log_sd_repeat.value)[:, factors.speed.of_case] ** 2 + variance
        of_mean = of_one / np.maximum(factors.repeats, 1)
        each = zip(parameters, middle, of_mean, strict=True)
        apart = np.stack([_look_apart(*one, factors, weight, priors.apart_widening) for one in each])
    looks = jnp.asarray(discordant), jnp.asarray(apart)
    terms = _terms(middle, [factors.design(parameter) for parameter in parameters])
    return CaseEstimates(jnp.asarray(middle), jnp.asarray(variance), log_sd_repeat, *looks, jnp.asarray(terms))


def _terms(
    values: Float[np.ndarray, "parameters cases"], designs: Sequence[Float[np.ndarray, "cases _"]]
) -> Float[np.ndarray, "parameters most"]:
    """Return least squares of the terms of each design, shorter rows filled up."""
    rows = [_least_squares(*both, np.ones(len(both[0]))) for both in zip(designs, values, strict=True)]
    return np.stack([np.pad(row, (0, max(map(len, rows)) - len(row))) for row in rows])


def _least_squares(
    design: Float[np.ndarray, "cases terms"], values: Float[np.ndarray, " cases"], weight: Float[np.ndarray, " cases"]
) -> Float[np.ndarray, " terms"]:
    """Return weighted least squares; terms that the cases leave open are near zero."""
    normal = (design.T * weight) @ design
    ridge = _RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
    return np.linalg.solve(normal + ridge, design.T @ (weight * values))


def _look_discordant(
    deviation: Float[np.ndarray, "records parameters"],
    variance: Float[np.ndarray, "records parameters"],
    sd_repeat: Float[np.ndarray, "records parameters"],
    priors: Priors,
) -> Bool[np.ndarray, " records"]:
    """Return which records are likelier discordant than usual, by how far they lie from the median of their case."""
    usual, widened = (
        stats.norm.logpdf(deviation, 0.0, np.sqrt((widening * sd_repeat) ** 2 + variance)).sum(axis=1)
        for widening in (1.0, priors.discordant_widening)
    )
    weight = priors["discordant_weight"].scipy().mean()
    return np.log(weight) + widened > np.log1p(-weight) + usual


def _look_apart(
    parameter: str,
    values: Float[np.ndarray, " cases"],
    variance: Float[np.ndarray, " cases"],
    factors: Factors,
    weight: float,
    widening: float,
) -> Bool[np.ndarray, " cases"]:
    """Return which cases are likelier to stand apart than not, by how far they lie from what their factors predict.

    The prediction is that of least absolute deviations, which a case that stands apart does not move.
    """
    spare = factors.spare_cases(parameter)
    if not spare:
        return np.zeros(len(values), dtype=bool)
    off = _least_absolute_residuals(factors.design(parameter), values)
    # As many residuals as the design has columns vanish; the median of others is 0.67 standard deviations.
    typical = max(np.median(np.sort(np.abs(off))[-spare:]) / 0.67, _LEAST_RESIDUAL)
    remainder = np.maximum(typical**2 - variance, 0.1 * typical**2)
    usual, wider = (stats.norm.logpdf(off, 0.0, np.sqrt(times**2 * remainder + variance)) for times in (1.0, widening))
    return np.log(weight) + wider > np.log1p(-weight) + usual


def _least_absolute_residuals(
    design: Float[np.ndarray, "cases terms"], values: Float[np.ndarray, " cases"]
) -> Float[np.ndarray, " cases"]:
    """Return residuals of least absolute deviations, by least squares weighted with the residuals' own inverse."""
    off = values - np.median(values)
    for _ in range(_ROUNDS):
        off = values - design @ _least_squares(design, values, 1.0 / np.maximum(np.abs(off), _LEAST_RESIDUAL))
    return off


def _log_sd_repeat(
    by_case: list[np.ndarray], variance: np.ndarray, factors: Factors
) -> tuple[Float[np.ndarray, " speeds"], Float[np.ndarray, " speeds"]]:
    """Return estimates and precisions of the scatter of repeats by speed.

    They are from the median over cases of their variance: robust to discordant repeats.
    """
    spare = factors.repeats - 1
    estimates, precisions = [], []
    for speed in range(len(factors.speed.labels)):
        cases = np.flatnonzero((factors.speed.of_case == speed) & (spare > 0))
        if not len(cases):
            estimates.append(np.log(_UNKNOWN_SD))
            precisions.append(0.0)
            continue
        # The median of a chi-squared number is 0.7 of its mean with two degrees of freedom, near it with others.
        total = max(float(np.median([np.var(by_case[case], ddof=1) for case in cases])) / 0.7, 1e-6)
        own = max(total - float(np.mean(variance[cases])), 0.1 * total)
        estimates.append(0.5 * np.log(own))
        precisions.append(2.0 * spare[cases].sum() * (own / total) ** 2)
    return np.array(estimates), np.array(precisions)


class KindsOfCase(NamedTuple):
    """Information of the cases on the terms, summed over those of a kind, whose estimates have one variance.

    Attributes
    ----------
    design:
        What each term adds to each case, shape (parameters, cases, terms).
    member:
        Whether a case is of a kind, shape (cases, kinds).
    """

    design: Float[np.ndarray, "parameters cases terms"]
    member: Float[np.ndarray, "cases kinds"]

    def estimate(
        self, values: Float[ArrayLike, "parameters cases"], variance: Float[Array, "parameters cases"]
    ) -> QuadraticApproximation:
        """Return the estimate of the terms from one of each case, with the mean variance of its kind."""
        precision = self._precision(variance)
        of_cases = precision @ jnp.asarray(self.member.T)
        slope = jnp.einsum("pct,pc->pt", jnp.asarray(self.design), of_cases * values)
        products = np.einsum("pct,ck,pcs->pkts", self.design, self.member, self.design, optimize=True)
        of_terms = jnp.einsum("pk,pkts->pts", precision, jnp.asarray(products))
        return QuadraticApproximation(jnp.zeros_like(slope), slope, of_terms)

    def each_alone(
        self, terms: Float[Array, "parameters terms"], variance: Float[Array, "parameters cases"]
    ) -> Gaussian:
        """Return what `estimate` says of each term were the others at these values, those of least squares."""
        squares = np.einsum("pct,ck->pkt", self.design**2, self.member)
        return Gaussian(terms, jnp.einsum("pk,pkt->pt", self._precision(variance), jnp.asarray(squares)))

    def _precision(self, variance: Float[Array, "parameters cases"]) -> Float[Array, "parameters kinds"]:
        """Return the precision of the estimate of a case of each kind."""
        return 1.0 / (variance @ jnp.asarray(self.member / self.member.sum(axis=0)))


def find_kinds(design: Float[np.ndarray, "parameters cases terms"], factors: Factors) -> KindsOfCase:
    """Return the kinds of the cases: those at one speed with as many repeats are alike.

    Hundreds of cases are then no more work in a gradient than a dozen kinds. Few are taken one by one.
    """
    kind = np.arange(len(factors.cases))
    if len(kind) > _FEW_CASES:
        both = np.stack([factors.speed.of_case, factors.repeats])
        kind = np.unique(both, axis=1, return_inverse=True)[1].ravel()
    return KindsOfCase(design, np.eye(kind.max() + 1)[kind])
