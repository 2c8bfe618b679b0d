"""Log predictive densities of units left out, such as records, from those at draws of the posterior with them.

Draws of the posterior with a unit are reweighted to the posterior without it, by ArviZ's leave-one-out with
Pareto-smoothed importance sampling (Vehtari et al. 2024); where k-hat says that this fails, the model is fitted again
without the unit.
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
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST

#: Least effective number of points of the integral over a record's own parameters.
EFFECTIVE_LEAST = 20.0


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
    """

    elpd: ELPDData
    pareto_k: Float[np.ndarray, " units"]
    refitted: np.ndarray
    effective_points: Float[np.ndarray, " units"]


def left_out(
    by_chain: Float[np.ndarray, "chains draws units"],
    units: Sequence[str],
    effective: Float[np.ndarray, " units"],
    refit_without: Callable[[int], float] | None,
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
        Gives the log predictive density of a unit from a fit without it, where importance sampling fails; None:
        no refit.
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
    failed, values = np.zeros(len(pareto_k), bool), elpd.elpd_i.copy()
    if refit_without is not None:
        failed = pareto_k > PARETO_K_MOST
        for unit in map(int, np.flatnonzero(failed)):
            on_refit(units[unit])
            refitted = attempt(f"fit without {units[unit]}", partial(refit_without, unit), None)
            failed[unit] = refitted is not None
            values[unit] = values[unit] if refitted is None else refitted
    elpd.elpd_i, elpd.elpd = values, float(values.sum())
    elpd.se = float(np.sqrt(len(values) * values.var(ddof=1)))  # as ArviZ has it
    return LeaveOneOut(elpd, pareto_k, failed, effective)
