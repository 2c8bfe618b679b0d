"""Estimates of one recording by `thesis`, `inertia` and `motion`: values with 95 % intervals, or why there are none."""

import functools
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Float
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.settings import FitSettings
from bayes_tyre.inference.least_squares.table import fit_records
from bayes_tyre.inference.motion.cycle.energy import losses
from bayes_tyre.inference.motion.record.estimate import RECORD_PARAMETERS, estimate_motion
from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.record_table import check_record_table
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.processed import Processed, Recording
from bayes_tyre.studies.audit.grid import INITIAL_LOAD_KN, Tyre

#: The parameters that each method estimates. Eq. 2 has no x, and so no energy: the energy of `thesis` and `inertia` is
#: that of their k and beta with the true x.
ESTIMATED = {
    "thesis": ("k", "beta", "energy_with_true_x"),
    "inertia": ("k", "beta", "energy_with_true_x"),
    "motion": ("k", "beta", "x", "energy_per_cycle"),
}
UNITS = {"k": "kN/mm", "beta": "mm", "x": "kN", "energy_per_cycle": "J", "energy_with_true_x": "J"}
#: Least-squares settings of each method's records, as for `lsq`; `motion` has its own fit.
SETTINGS = {"thesis": FitSettings(region="thesis"), "inertia": FitSettings(bounds={"beta": (-np.inf, 1.0)})}
#: Half the stroke of the cycle of the energy, mm at the wheel centre: about a 10 kN step's.
AMPLITUDE_MM = 2.0
_COLUMNS = {"k": "k_kN_per_mm", "beta": "beta_mm"}
_NORMAL_95 = float(stats.norm.ppf(0.975))


class MethodEstimate(NamedTuple):
    """A method's estimate of a record: (value, lower, upper) by parameter, and ``ok`` or why it is not reliable.

    `values` is empty where the method returns nothing; lower and upper are NaN where the method gives no interval.
    """

    values: dict[str, tuple[float, float, float]]
    status: str


def curve(processed: Processed) -> pd.DataFrame:
    """Return a record's columns as the least squares need them."""
    return pd.DataFrame({"displacement_mm": processed.displacement_mm, "force_kN": processed.force_kN})


def least_squares_estimates(
    curves: Sequence[pd.DataFrame | str], truths: Sequence[Tyre], method: str, rig: Rig
) -> list[MethodEstimate]:
    """Return the least-squares estimates of Eq. 2 of each curve, with intervals by Student's t.

    Parameters
    ----------
    curves:
        Records of one method, mm and kN; or why there is none.
    truths:
        The truth of each.
    method:
        A name in `SETTINGS`.
    rig:
        For the energy at the wheel centre.
    """
    named = [one.assign(record=str(i)) for i, one in enumerate(curves) if isinstance(one, pd.DataFrame)]
    fits: dict[str, Mapping[Hashable, Any]] = {}
    if named:
        table = check_record_table(pd.concat(named, ignore_index=True).assign(origin="simulated"))
        rows = fit_records(table, SETTINGS[method]).to_dict("records")
        fits = {str(row["record"]): row for row in rows}
    return [
        MethodEstimate({}, one) if isinstance(one, str) else _of_fit(fits[str(i)], truth, rig)
        for i, (one, truth) in enumerate(zip(curves, truths, strict=True))
    ]


def _of_fit(fit: Mapping[Hashable, Any], truth: Tyre, rig: Rig) -> MethodEstimate:
    status, quantile = str(fit["status"]), float(stats.t.ppf(0.975, max(1, int(fit["points"]) - 3)))
    fitted = {name: (float(fit[column]), float(fit[f"{column}_se"])) for name, column in _COLUMNS.items()}
    # A value without a standard error is not determined by the record (see `status`), and is left out.
    values = {
        name: (value, value - quantile * se, value + quantile * se)
        for name, (value, se) in fitted.items()
        if np.isfinite([value, se]).all()
    }
    if len(values) < len(fitted):
        return MethodEstimate(values, status)
    k, beta = values["k"][0], values["beta"][0]
    energy = energy_J(rig, truth, k, truth.x_kN, beta) if k > 0 else np.nan
    return MethodEstimate(values | {"energy_with_true_x": (energy, np.nan, np.nan)}, status)


def motion_estimate(recording: Recording, truth: Tyre, rig: Rig) -> MethodEstimate:
    """Return the estimate of a recording by the fit of its motion, intervals normal in the logarithms."""
    try:
        estimate = estimate_motion(rig, Recorded(*recording.for_motion()))
    except BadInput as error:
        return MethodEstimate({}, str(error))
    return motion_values(estimate.log_mean, estimate.log_covariance, estimate.status, truth, rig)


def motion_values(
    log_mean: Float[np.ndarray, "5"], log_covariance: Float[np.ndarray, "5 5"], status: str, truth: Tyre, rig: Rig
) -> MethodEstimate:
    """Return k, beta, x and the energy of a cycle from the logarithms of `RECORD_PARAMETERS`."""
    if not (np.isfinite(log_mean).all() and np.isfinite(log_covariance).all()):
        return MethodEstimate({}, status or "the motion's estimate is not finite")
    index = [RECORD_PARAMETERS.index(name) for name in ("k", "x", "beta")]
    log_energy, slope = _log_energy(rig, jnp.asarray(log_mean[index]), middle_mm(rig, truth))
    sd = np.sqrt(np.diag(log_covariance)[index])
    # The delta method: x > k beta in all laws of the fit, so that the energy is positive.
    of_energy = float(np.sqrt(np.asarray(slope) @ log_covariance[np.ix_(index, index)] @ np.asarray(slope)))
    means, sds = [*log_mean[index], float(log_energy)], [*sd, of_energy]
    values = {
        name: (float(np.exp(mean)), float(np.exp(mean - _NORMAL_95 * sd)), float(np.exp(mean + _NORMAL_95 * sd)))
        for name, mean, sd in zip(("k", "x", "beta", "energy_per_cycle"), means, sds, strict=True)
    }
    return MethodEstimate({name: values[name] for name in ESTIMATED["motion"]}, status or "ok")


def middle_mm(rig: Rig, truth: Tyre) -> float:
    """Return the middle of the cycle at the wheel centre, mm: where the tyre rests half-way through the load's step."""
    return geometry.wheel_centre_start(rig, INITIAL_LOAD_KN + truth.step_kN / 2, truth.k_kN_per_mm)


def energy_J(rig: Rig, truth: Tyre, k: float, x: float, beta: float) -> float:
    """Return the energy, J, of a cycle of `AMPLITUDE_MM` at the wheel centre by k (kN/mm), x (kN) and beta (mm).

    Negative where x < k beta. The cycle's middle is the truth's, whatever k is.
    """
    return float(_energy(rig, jnp.log(jnp.array([k, x, beta])), middle_mm(rig, truth)))


@functools.partial(jax.jit, static_argnums=0)
def _energy(rig: Rig, logs: Float[Array, "3"], middle: ScalarLike) -> Float[Array, ""]:
    k, x, beta = jnp.exp(logs)
    # The energy does not depend on the mass.
    return losses(rig, Fancher(k=k, C=0.0, x=x, beta=beta), 1.0, middle, AMPLITUDE_MM).energy_J


@functools.partial(jax.jit, static_argnums=0)
def _log_energy(rig: Rig, logs: Float[Array, "3"], middle: ScalarLike) -> tuple[Float[Array, ""], Float[Array, "3"]]:
    return jax.value_and_grad(lambda at: jnp.log(_energy(rig, at, middle)))(logs)


def true_value(parameter: str, truth: Tyre, rig: Rig) -> float:
    """Return the truth of a parameter of `UNITS`."""
    of_tyre = {"k": truth.k_kN_per_mm, "beta": truth.beta_mm, "x": truth.x_kN}
    if parameter in of_tyre:
        return of_tyre[parameter]
    return energy_J(rig, truth, truth.k_kN_per_mm, truth.x_kN, truth.beta_mm)
