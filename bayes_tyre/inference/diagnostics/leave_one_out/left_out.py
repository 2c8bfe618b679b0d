"""Log predictive densities of units left out, such as records, from those at draws of the posterior with them.

Draws of the posterior with a unit are reweighted to the posterior without it, by ArviZ's leave-one-out with
Pareto-smoothed importance sampling (Vehtari et al. 2024); where k-hat says that this fails for so many draws, the same
model is fitted again without the unit.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import arviz_base
import numpy as np
from arviz_stats import ELPDData
from arviz_stats.loo import loo
from jaxtyping import Float

from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.sampling.effective_sizes import statistics

#: Least effective number of points of the integral over a record's own parameters.
EFFECTIVE_LEAST = 20.0
#: Largest R-hat of a unit's log density in a fit without it. Of four chains of 125 independent draws the largest of
#: 200,000 was 1.04. An interval would need 1.01, an average does not.
R_HAT_MOST = 1.05
#: Least effective number of draws that the mean density of a unit rests on in a fit without it: its logarithm is then
#: known to a seventh of what the density scatters by, relative.
DRAWS_LEAST = 50.0


@dataclass(frozen=True)
class LeaveOneOut:
    """What a model predicts of each unit, a record or a case, that it has not seen.

    Attributes
    ----------
    elpd:
        ArviZ's sum and values of each unit of the log predictive density.
    pareto_k:
        Shape (units,): of the importance weights, before any refit.
    refitted:
        Shape (units,): True where the model was fitted again without the unit.
    effective_points:
        Shape (units,): effective number of points of the integral over the unit's own parameters.
    disagreeing:
        Shape (units,): True where the chains of the fit without the unit, or the halves of its only one, disagree on
        its log density.
    few_draws:
        Shape (units,): True where that fit has fewer effective draws of the log density than `DRAWS_LEAST`.
    """

    elpd: ELPDData
    pareto_k: Float[np.ndarray, " units"]
    refitted: np.ndarray
    effective_points: Float[np.ndarray, " units"]
    disagreeing: np.ndarray
    few_draws: np.ndarray

    @property
    def trusted(self) -> bool:
        """Whether every log density is known well enough: by importance sampling, or by a fit that converged."""
        handled = self.refitted | (self.pareto_k <= self.elpd.good_k)
        unsound = self.disagreeing | self.few_draws
        return bool(handled.all() and not unsound.any() and self.effective_points.min() >= EFFECTIVE_LEAST)


def left_out(
    by_chain: Float[np.ndarray, "chains draws units"],
    units: Sequence[str],
    effective: Float[np.ndarray, " units"],
    refit_without: Callable[[int], Float[np.ndarray, "chains draws"]] | None,
    on_refit: Callable[[str], None],
    attempt: Attempt = directly,
) -> LeaveOneOut:
    """Return the log predictive densities of units left out, from those at draws of the posterior with them.

    Parameters
    ----------
    by_chain:
        Log densities of the units, their own parameters integrated out.
    units:
        Names of records, or labels of cases.
    effective:
        Effective numbers of points of those integrals.
    refit_without:
        Gives the log density of a unit at draws of a fit without it, where importance sampling fails; None: no refit.
    on_refit:
        Called with the unit's name before each refit.
    attempt:
        Runs each refit.
    """
    tree = arviz_base.from_dict(
        {"posterior": {"level": by_chain.mean(axis=2)}, "log_likelihood": {"record_force": by_chain}},
        coords={"record": list(units)},
        dims={"record_force": ["record"], "level": []},
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Estimated shape parameter", UserWarning)
        elpd = loo(tree, pointwise=True, reff=1.0)
    assert isinstance(elpd, ELPDData)
    pareto_k = elpd.pareto_k.to_numpy()
    refitted, disagreeing, few_draws = np.zeros((3, len(pareto_k)), bool)
    values, lppd = elpd.elpd_i.copy(), elpd.elpd + elpd.p
    for unit in map(int, np.flatnonzero(pareto_k > elpd.good_k)):
        if refit_without is None:
            break
        on_refit(units[unit])
        without = attempt(f"fit without {units[unit]}", partial(refit_without, unit), None)
        if without is not None:
            refitted[unit] = True
            values[unit] = np.logaddexp.reduce(without, axis=None) - np.log(without.size)
            r_hat, ess = _convergence(without)
            disagreeing[unit] = r_hat > R_HAT_MOST or not np.isfinite(values[unit])
            few_draws[unit] = ess < DRAWS_LEAST
    elpd.elpd_i, elpd.elpd = values, float(values.sum())
    elpd.se = float(np.sqrt(len(values) * values.var(ddof=1)))  # as ArviZ has it
    elpd.p = lppd - elpd.elpd
    return LeaveOneOut(elpd, pareto_k, refitted, effective, disagreeing, few_draws)


def _convergence(draws: Float[np.ndarray, "chains draws"]) -> tuple[float, float]:
    """Return R-hat and bulk ESS of a log density; a single chain is judged as its two halves."""
    if len(draws) == 1:
        draws = draws[:, draws.shape[1] % 2 :].reshape(2, -1)
    of_density = statistics(draws[:, :, None])
    return float(of_density.r_hat[0]), float(of_density.ess_bulk[0])
