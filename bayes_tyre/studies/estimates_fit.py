"""The fits of estimates, compiled once for as many simulated data sets as will come: printed case means, and motions.

Like `bayes_tyre.studies.design_fit.DesignFit`, with the priors and the samplers that ship. Of a motion its estimate is
simulated: a normal of the logarithms, as `bayes_tyre.inference.motion.record.likelihood` hands it to the hierarchy.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import norm, t

from bayes_tyre.inference.model.coordinates.sites import hyperparameter_starts, published_in_coordinates
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, motion_sites, published_sites
from bayes_tyre.inference.model.models import published_model
from bayes_tyre.inference.model.prior_predictive import draw_prior
from bayes_tyre.inference.motion.hierarchy.model import Motions, motion_arguments, motions_in_coordinates, motions_model
from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE, Chains
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.published import tables
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.studies.design import Design
from bayes_tyre.studies.design_fit import SimulatedSets, Thinned, sample_each
from bayes_tyre.studies.ranked_quantities import Hierarchy
from bayes_tyre.studies.truths import Planted, Truths

#: Relative standard deviations of k, x - k beta, beta, m and c in the estimate of a standing motion, and their
#: correlations, as a ring-down has them: k and m make the frequency, x and beta the first millimetres.
_SD = np.array([0.01, 0.05, 0.10, 0.015, 0.15])
_CORRELATED = {(0, 3): 0.8, (1, 2): -0.5, (1, 4): -0.4}
#: How many times as wide the estimates of rolling records are.
_WIDER = 4.0
_MIXTURE = "mixture"
#: How much to sample of motions: five parameters of each record mix more slowly than two.
MOTIONS = Thinned(SamplerSettings(chains=2, warmup=300, draws=600), thin=15)


class PublishedFit:
    """The fit of printed case means, those of Tables 9 and 11 in number and factors.

    Parameters
    ----------
    sampling:
        How much to sample of each data set.
    """

    def __init__(self, sampling: Thinned | None = None) -> None:
        self.sampling = sampling or Thinned()
        factors = find_factors(tables.case_means()[list(CASE_FACTORS)])
        self.hierarchy = Hierarchy(factors, PRIORS, published_sites(factors))
        self._starts = hyperparameter_starts(self.hierarchy.sites, PRIORS.medians())
        settings, ones = self.sampling.settings, np.ones((len(PARAMETERS), len(factors.cases)))
        blank = self._arguments(ones)
        self._chains = Chains(published_in_coordinates, blank, settings.chains, settings.warmup, self._starts)

    def simulated(
        self, sets: int, of_truths: int, of_sampler: int, planted: Planted, on_progress: Callable[[int], None]
    ) -> SimulatedSets:
        """Return data sets drawn from the priors and what was sampled of each, as `calibrate` asks for them."""
        arguments = {"values": None, "factors": self.hierarchy.factors}
        truths = draw_prior(published_model, arguments, [*QUANTITIES, "log_published"], sets, of_truths)
        drawn, typical = truths.pop("log_published"), _log_values(truths, "_case")
        printed = typical + planted.noise * (drawn - typical)
        each = (self._chains.given(self._arguments(np.exp(one)), self._starts) for one in printed)
        sampled = sample_each(each, self.sampling, of_sampler, on_progress)
        both = self._log_likelihood(truths, printed), self._log_likelihood(sampled.draws, printed[:, None])
        return SimulatedSets(truths, sampled, both)

    def _arguments(self, values: Float[np.ndarray, "parameters cases"]) -> dict[str, Any]:
        by_name = {name: jnp.asarray(each) for name, each in zip(PARAMETERS, values, strict=True)}
        return {"values": by_name, "factors": self.hierarchy.factors, "priors": PRIORS}

    def _log_likelihood(
        self, values: Truths, printed: Float[np.ndarray, "*#sets parameters cases"]
    ) -> Float[np.ndarray, "*sets cases"]:
        speed = self.hierarchy.factors.speed.of_case
        sd_published = np.stack(
            [values[f"sd_log_{name}_published_by_speed"][..., speed] for name in PARAMETERS], axis=-2
        )
        nu = values["student_nu"][..., None, None]
        return t.logpdf(printed, nu, _log_values(values, "_case"), sd_published).sum(axis=-2)


class MotionsFit:
    """The fit of motions on Fancher's law, from estimates of the tests of a design.

    Parameters
    ----------
    design:
        What is tested.
    sampling:
        How much to sample of each data set.
    """

    def __init__(self, design: Design, sampling: Thinned | None = None) -> None:
        self.sampling, self._design = sampling or MOTIONS, design
        factors, parameters = design.factors, FANCHER.parameters
        self.hierarchy = Hierarchy(factors, PRIORS, motion_sites(factors, _MIXTURE, parameters), parameters)
        correlation = np.eye(len(_SD))
        for place, value in _CORRELATED.items():
            correlation[place] = correlation[place[::-1]] = value
        wider = np.where(design.factor_table["speed_km_h"] > 0, _WIDER, 1.0)
        self._covariance = wider[:, None, None] ** 2 * (_SD[:, None] * correlation * _SD)
        self._rows = np.linalg.inv(np.linalg.cholesky(self._covariance))
        settings, blank = self.sampling.settings, self._arguments(np.zeros(self._rows.shape[:2]))
        self._chains = Chains(
            motions_in_coordinates, blank[0], settings.chains, settings.warmup, blank[1], CAREFUL_ACCEPTANCE
        )

    def simulated(
        self, sets: int, of_truths: int, of_sampler: int, planted: Planted, on_progress: Callable[[int], None]
    ) -> SimulatedSets:
        """Return data sets drawn from the priors and what was sampled of each, as `calibrate` asks for them."""
        arguments = {"rows": jnp.asarray(self._rows), "target": None, "factors": self.hierarchy.factors}
        truths = draw_prior(motions_model, arguments, [*QUANTITIES, "readings"], sets, of_truths)
        drawn, true = truths.pop("readings"), self._whitened(truths)
        readings = true + planted.noise * (drawn - true)
        each = (self._chains.given(*self._arguments(one)) for one in readings)
        sampled = sample_each(each, self.sampling, of_sampler, on_progress)
        both = self._log_likelihood(truths, readings), self._log_likelihood(sampled.draws, readings[:, None])
        return SimulatedSets(truths, sampled, both)

    def _arguments(self, readings: Float[np.ndarray, "records p"]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        log_mean = np.linalg.solve(self._rows, readings[..., None])[..., 0]
        variance = np.diagonal(self._covariance, axis1=1, axis2=2)
        motions = Motions(self._design.factor_table, self._rows, readings, log_mean, variance)
        return motion_arguments(motions, _MIXTURE, self.hierarchy.factors, PRIORS)

    def _whitened(self, values: Truths) -> Float[np.ndarray, "*sets records p"]:
        return np.einsum("rij,...jr->...ri", self._rows, _log_values(values, "", self.hierarchy.parameters))

    def _log_likelihood(
        self, values: Truths, readings: Float[np.ndarray, "*#sets records p"]
    ) -> Float[np.ndarray, "*sets records"]:
        return norm.logpdf(readings - self._whitened(values)).sum(axis=-1)


def _log_values(values: Truths, ending: str, parameters: Sequence[str] = PARAMETERS) -> Float[np.ndarray, "..."]:
    """Return the logarithms of the values of records or cases, parameters along the last axis but one."""
    return np.log(np.stack([values[f"{name}{ending}"] for name in parameters], axis=-2))
