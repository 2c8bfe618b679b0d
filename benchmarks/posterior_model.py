"""The posterior of `bayes_tyre.inference.model.models.records_model`, written plainly for PyMC and for NumPyro.

Centred but for sigma: the form that suits the peers best. The likelihood is point by point on padded arrays, and the
mixtures of discordant repeats and of cases that stand apart are summed out. The priors are those of
`bayes_tyre.inference.model.default_priors`, the levels those of `factors`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpyro
import pandas as pd
import pymc as pm
import pytensor.tensor as pt
from numpyro import distributions as dist

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, laplace_approximation
from bayes_tyre.inference.model.default_priors import APART_WEIGHT, APART_WIDENING, DISCORDANT_WIDENING, PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.record_table import record_factors


@dataclass(frozen=True)
class Data:
    """Records side by side, and their levels; u (mm) and y (kN): displacement and force from the first point on."""

    u: np.ndarray
    y: np.ndarray
    present: np.ndarray
    d_0: np.ndarray
    F_0: np.ndarray
    span: np.ndarray
    factors: Factors
    approximation: LaplaceApproximation

    @property
    def points(self) -> np.ndarray:
        """Number of points of each record."""
        return self.present.sum(axis=1)

    @property
    def starts(self) -> dict[str, np.ndarray]:
        """Return where every peer starts: the least-squares estimates."""
        centre, log_sigma = (
            np.asarray(self.approximation.records.centre),
            np.asarray(self.approximation.records.log_sigma),
        )
        F_i, J, log_k, log_beta = centre.T
        log_k_case, log_beta_case = np.asarray(self.approximation.cases.middle)
        cases = {"log_k_case": log_k_case, "log_beta_case": log_beta_case}
        sigma = {"sigma_typical": np.exp(log_sigma.mean()), "sigma_coordinates": np.zeros(len(log_sigma))}
        return {"F_i": F_i, "J": J, "log_k": log_k, "log_beta": log_beta, **sigma, **cases}


def data_of(table: pd.DataFrame) -> Data:
    """Return what the peers' models are given, from a checked record table."""
    batch: Batch = record_batch(table)
    factors = find_factors(record_factors(table))
    d, F = batch.displacement_mm, batch.force_kN
    y = np.where(batch.present, F - F[:, :1], 0.0)
    u = np.where(batch.present, d - d[:, :1], 0.0)
    span = np.abs(y).max(axis=1)
    return Data(u, y, batch.present, d[:, 0], F[:, 0], span, factors, laplace_approximation(batch, factors))


class _PyMC:
    """The few words that the model needs, as PyMC has them."""

    exp, log = staticmethod(pt.exp), staticmethod(pt.log)
    log1p, logaddexp = staticmethod(pt.log1p), staticmethod(pt.logaddexp)

    def __init__(self, starts: dict[str, np.ndarray]) -> None:
        self.starts = starts

    def prior(self, name: str) -> Any:
        family = {"HalfNormal": pm.HalfNormal, "LogNormal": pm.LogNormal, "Beta": pm.Beta}[PRIORS[name].family.__name__]
        return family(name, *PRIORS[name].parameters, initval=self.starts.get(name))

    def normal(self, name: str, mean: Any, sd: Any, size: int) -> Any:
        return pm.Normal(name, mean, sd, shape=size, initval=self.starts.get(name))

    def flat(self, name: str, size: int) -> Any:
        return pm.Flat(name, shape=size, initval=self.starts[name])

    add, keep = staticmethod(pm.Potential), staticmethod(pm.Deterministic)

    def sum(self, x: Any) -> Any:
        return pt.sum(x, axis=1)


class _NumPyro:
    """The same words as NumPyro has them."""

    def __init__(self) -> None:
        import jax.numpy as jnp

        self.exp, self.log, self.log1p, self.logaddexp = jnp.exp, jnp.log, jnp.log1p, jnp.logaddexp

    def prior(self, name: str) -> Any:
        return numpyro.sample(name, PRIORS[name].distribution())

    def normal(self, name: str, mean: Any, sd: Any, size: int) -> Any:
        return numpyro.sample(name, dist.Normal(mean, sd).expand((size,)))

    def flat(self, name: str, size: int) -> Any:
        return numpyro.sample(name, dist.ImproperUniform(dist.constraints.real, (), (size,)))

    add, keep = staticmethod(numpyro.factor), staticmethod(numpyro.deterministic)

    def sum(self, x: Any) -> Any:
        return x.sum(axis=1)


def _case_level(lang: Any, name: str, data: Data) -> tuple[Any, Any]:
    """Return the logarithm of k or beta of each record's case, and the scatter of repeats about it."""
    factors = data.factors
    location, width = PRIORS[f"{name}_group"].parameters
    cell = lang.normal(f"log_{name}_group", location, width, len(factors.group.labels))
    lang.keep(f"{name}_group", lang.exp(cell))
    mean = cell[factors.group.of_case]
    for which, factor in factors.effects(name).items():
        scale = lang.prior(f"sd_log_{name}_{which}")
        coordinates = lang.normal(f"{name}_{which}_coordinates", 0.0, scale, factor.basis.shape[1])
        effect = lang.keep(f"log_{name}_{which}", (factor.basis * coordinates).sum(axis=1))
        mean = mean + effect[factor.of_case] * factor.weight
    if factors.has_remainder(name):
        mean = _case(lang, name, mean, lang.prior(f"sd_log_{name}_case"), len(factors.cases))
    lang.keep(f"{name}_case", lang.exp(mean))
    typical = lang.prior(f"sd_log_{name}_repeat")
    spread = lang.prior(f"sd_log_{name}_repeat_over_speeds")
    log_sd_repeat = lang.normal(f"{name}_log_scatter", lang.log(typical), spread, len(factors.speed.labels))
    by_speed = lang.keep(f"sd_log_{name}_repeat_by_speed", lang.exp(log_sd_repeat))
    return mean[factors.of_record], by_speed[factors.speed.of_case][factors.of_record]


def _case(lang: Any, name: str, mean: Any, sd: Any, cases: int) -> Any:
    """Return the logarithm of each case, usual or apart from the others."""
    value = lang.flat(f"log_{name}_case", cases)

    def about(wide: Any) -> Any:
        return -0.5 * ((value - mean) / wide) ** 2 - lang.log(wide) - 0.5 * np.log(2.0 * np.pi)

    usual, apart = np.log1p(-APART_WEIGHT) + about(sd), np.log(APART_WEIGHT) + about(APART_WIDENING * sd)
    lang.add(f"{name}_cases", lang.logaddexp(usual, apart))
    return value


def _posterior(lang: Any, data: Data) -> None:
    """Say the model in a language; cases must have three repeats and several speeds, as the campaign's have."""
    if data.factors.repeats.max() < 3 or not data.factors.speed.varies:
        raise ValueError("this plain form is written for repeats and speeds such as the campaign's")
    count = len(data.F_0)
    case_k, scatter_k = _case_level(lang, "k", data)
    case_beta, scatter_beta = _case_level(lang, "beta", data)
    log_k, log_beta = lang.flat("log_k", count), lang.flat("log_beta", count)
    weight = lang.prior("discordant_weight")

    def about(widening: float) -> Any:
        a, b = widening * scatter_k, widening * scatter_beta
        squares = ((log_k - case_k) / a) ** 2 + ((log_beta - case_beta) / b) ** 2
        return -0.5 * squares - lang.log(a) - lang.log(b) - np.log(2.0 * np.pi)

    usual, discordant = lang.log1p(-weight) + about(1.0), lang.log(weight) + about(DISCORDANT_WIDENING)
    lang.add("repeats", lang.logaddexp(usual, discordant))
    F_i = lang.normal("F_i", data.F_0, data.span, count)
    J = lang.normal("J", 0.0, lang.prior("sd_J"), count)
    typical, spread = lang.prior("sigma_typical"), lang.prior("sd_log_sigma")
    # Not centred: records are alike in their noise, and a spread near 0 would be a funnel.
    log_sigma = lang.keep("log_sigma", lang.log(typical) + spread * lang.normal("sigma_coordinates", 0.0, 1.0, count))
    sigma, k, beta = (
        lang.keep(name, lang.exp(x)) for name, x in (("sigma", log_sigma), ("k", log_k), ("beta", log_beta))
    )
    gone = 1.0 - lang.exp(-np.abs(data.u) / beta[:, None])
    residual = (F_i - data.F_0)[:, None] + (J[:, None] + k[:, None] * data.u) * gone - data.y
    rss = lang.sum(data.present * residual**2)
    lang.add("force", -0.5 * rss / sigma**2 - data.points * (log_sigma + 0.5 * np.log(2.0 * np.pi)))
    lang.keep("C", F_i + J - k * data.d_0)


def pymc_model(data: Data) -> pm.Model:
    """Return the PyMC model."""
    with pm.Model() as model:
        _posterior(_PyMC(data.starts), data)
    return model


def numpyro_model(data: Data) -> None:
    """Model the records (NumPyro model)."""
    _posterior(_NumPyro(), data)
