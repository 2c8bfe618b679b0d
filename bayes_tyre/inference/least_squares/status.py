"""The status of each fit: `ok`, or the reasons why the record cannot be fitted or the estimate is not reliable."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import SMOOTHED, lag_1
from bayes_tyre.inference.lack_of_fit import MISFIT_MOST, curve_tangents, misfit
from bayes_tyre.inference.least_squares.estimate import Estimate
from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, PARAMETERS, C, K
from bayes_tyre.laws.fancher import equation_2

#: Displacements and forces above this overflow in sums of squares, travels and changes of force below the inverse
#: underflow; neither is a measurement.
LARGEST = 1e100
#: Part of the travel by which displacement may turn back, by noise or overshoot, within one step.
TURNS_BACK = 0.25
#: Residuals are checked for autocorrelation from this many points on, and where their root mean square is above this
#: part of the change of force; below it they are rounding.
CORRELATION_POINTS, CORRELATION_RMS = 50, 1e-9
#: Standard errors by which k may be below zero, as noise has it.
NEGATIVE_ERRORS = 2.0


def unfittable(batch: Batch, used: Bool[np.ndarray, "records points"], unknowns: int) -> np.ndarray:
    """Return, a record, why it cannot be fitted; empty where it can.

    Parameters
    ----------
    batch, used:
        The records, and which of their points are used.
    unknowns:
        Number of parameters to fit.
    """
    d, F = (_Extent.of(rows) for rows in _points(batch, used))
    points = used.sum(axis=1)
    least = np.minimum(d.travel, np.where(F.high > F.low, F.travel, 1))
    reasons = np.full(len(points), "", dtype=object)
    reasons[least < 1 / LARGEST] = f"changes below {1 / LARGEST:g}: too small to be squared, check the cells"
    reasons[np.maximum(d.size, F.size) > LARGEST] = (
        f"numbers above {LARGEST:g}: too large to be squared, check the cells"
    )
    reasons[d.high == d.low] = "no travel: the displacement is constant"
    few = points <= unknowns
    reasons[few] = [f"too few points: {number} for {unknowns} parameters" for number in points[few]]
    return reasons


def status(
    batch: Batch,
    used: Bool[np.ndarray, "records points"],
    estimate: Estimate,
    bounds: Float[np.ndarray, "2 5"],
    unfittable: np.ndarray,
    free: tuple[int, ...],
) -> np.ndarray:
    """Return, a record, ``ok`` or why the estimate is not reliable.

    `bounds` (kN, mm): low and high; `free`: indices into `PARAMETERS` of those that were fitted.
    """
    result = unfittable.copy()
    result[(result == "") & ~np.asarray(estimate.converged)] = (
        "did not converge: give a --start nearer to the data, or fix a parameter"
    )
    fitted = result == ""
    wrong_curve, of_the_residuals = _of_the_residuals(batch, used, estimate, fitted, free)
    reasons = (
        *_of_the_points(batch, used),
        *_of_bounds(estimate, bounds),
        # What another curve determines of the parameters of this one is its consequence.
        *((holds & ~wrong_curve, reason) for holds, reason in _of_the_estimate(estimate)),
        *of_the_residuals,
    )
    for holds, reason in reasons:
        rows = np.flatnonzero(fitted & holds)
        result[rows] = [f"{result[row]}; {reason}" if result[row] else reason for row in rows]
    k, error = (np.asarray(field)[:, K] for field in (estimate.value, estimate.standard_error))
    # Where another reason is given it is a consequence, and its error means little.
    result[(result == "") & (k < -NEGATIVE_ERRORS * error)] = (
        "k is negative by more than two standard errors: check the signs, or the law"
    )
    result[result == ""] = "ok"
    return result


Reasons = list[tuple[np.ndarray, str]]
"""Which records a reason holds for, shape (records,), and its text."""


def _points(batch: Batch, used: Bool[np.ndarray, "records points"]) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and force, unused points replaced by the first."""
    d, F = batch.displacement_mm, batch.force_kN
    if used.all():
        return d, F
    return np.where(used, d, d[:, :1]), np.where(used, F, F[:, :1])


class _Extent(NamedTuple):
    """Minimum, maximum and largest magnitude of each record's values, and their largest distance from the first."""

    low: Float[np.ndarray, " records"]
    high: Float[np.ndarray, " records"]
    size: Float[np.ndarray, " records"]
    travel: Float[np.ndarray, " records"]

    @classmethod
    def of(cls, values: Float[np.ndarray, "records points"]) -> "_Extent":
        low, high, first = values.min(axis=1), values.max(axis=1), values[:, 0]
        with np.errstate(over="ignore"):
            return cls(low, high, np.maximum(-low, high), np.maximum(first - low, high - first))


def _of_the_points(batch: Batch, used: Bool[np.ndarray, "records points"]) -> Reasons:
    d, F = _points(batch, used)
    rows, last = np.arange(len(d)), used.sum(axis=1) - 1
    with np.errstate(over="ignore", invalid="ignore"):  # of records that cannot be fitted
        u = d - d[:, :1]
        farthest = u[rows, np.abs(u).argmax(axis=1)]
        forward = u * np.sign(farthest)[:, None]
        reversal = (np.maximum.accumulate(forward, axis=1) - np.where(used, forward, np.inf)).max(axis=1)
        falls = np.sign(F[rows, last] - F[:, 0]) * np.sign(u[rows, last]) < 0
        turns = reversal > TURNS_BACK * np.abs(farthest)
    return [
        (falls, "force falls as displacement grows: check the signs"),
        (turns, "displacement turns back: Equation 2 holds for one direction, cut the record there"),
    ]


def _of_bounds(estimate: Estimate, bounds: Float[np.ndarray, "2 5"]) -> Reasons:
    at_bound, value = np.asarray(estimate.at_bound), np.asarray(estimate.value)
    return [
        (at_bound[:, i] & (value[:, i] == bound), f"{name} at its bound {bound:.15g}")
        for i, name in enumerate(PARAMETERS)
        for bound in bounds[:, i]
        if np.isfinite(bound)
    ]


def _of_the_estimate(estimate: Estimate) -> Reasons:
    below, above = np.asarray(estimate.beta_open_below), np.asarray(estimate.beta_open_above)
    lost = np.asarray(estimate.undetermined) & ~(below | above)[:, None]
    beta, error = (np.asarray(field)[:, BETA] for field in (estimate.value, estimate.standard_error))
    return [
        (below & above, "beta not determined: this record bounds it neither below nor above"),
        (below & ~above, "beta not determined: only an upper bound, it lies below the spacing of the first points"),
        (above & ~below, "beta not determined: only a lower bound, beyond the travel it trades against k"),
        (~(below | above) & (error >= beta), "beta weakly identified: its standard error is as large as itself"),
        *(
            ((lost == which).all(axis=1), f"{', '.join(np.array(PARAMETERS)[which])} not determined by this record")
            for which in np.unique(lost, axis=0)
            if which.any()
        ),
    ]


def _of_the_residuals(
    batch: Batch,
    used: Bool[np.ndarray, "records points"],
    estimate: Estimate,
    fitted: np.ndarray,
    free: tuple[int, ...],
) -> tuple[np.ndarray, Reasons]:
    """Return which records follow another curve, and with these which are smoothed or have too few points to say."""
    of_curve = [i for i in (K, C, BETA) if i in free]
    checked = fitted & np.isfinite(np.asarray(estimate.standard_error)[:, of_curve]).all(axis=1)
    if not checked.any():
        return checked, []
    points = used.sum(axis=1)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # of records that cannot be fitted
        rms = np.sqrt(np.asarray(estimate.rss) / points) / _Extent.of(_points(batch, used)[1]).travel
    d, F, value = (jnp.asarray(array) for array in (batch.displacement_mm, batch.force_kN, estimate.value))
    arrays = d, F, jnp.asarray(used), value
    wrong, cannot_tell = _misfits(arrays, checked & (rms > MISFIT_MOST))
    # Of a curve that is fixed in part, only a course is said.
    whole = np.isfinite(np.asarray(estimate.standard_error)[:, [K, C, BETA]]).all(axis=1)
    determined = checked & whole & ~np.asarray(estimate.beta_open_below) & ~np.asarray(estimate.beta_open_above)
    correlated = determined & ~wrong & (rms > CORRELATION_RMS) & (points >= CORRELATION_POINTS)
    return wrong, [
        (wrong, "the curve is not Equation 2: residuals have a course along the record"),
        (determined & cannot_tell, "residuals are large, and too few to tell noise from another curve"),
        *(_of_smoothing(np.asarray(_lag_1_of_residuals(*arrays)), correlated) if correlated.any() else ()),
    ]


_Arrays = tuple[
    Float[Array, "records points"],
    Float[Array, "records points"],
    Bool[Array, "records points"],
    Float[Array, "records 5"],
]
"""Displacement (mm), force (kN), which points are used, and the estimates."""


def _misfits(arrays: _Arrays, suspect: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which of the suspect records follow another curve, and which have too few points to say."""
    if not suspect.any():
        return suspect, suspect
    # Every record of a batch at once, whichever are suspect: one shape to compile.
    residual, tangents = _residuals_and_tangents(*arrays)
    _, force, used, _ = map(np.asarray, arrays)
    misfits = misfit(np.where(suspect[:, None], residual, 0.0), tangents, used, np.where(suspect[:, None], force, 0.0))
    return suspect & misfits.wrong_curve(), suspect & misfits.cannot_tell


def _of_smoothing(rho: np.ndarray, checked: np.ndarray) -> Reasons:
    """Return which of the records checked have residuals that follow each other from point to point."""
    checked = checked & (rho > SMOOTHED)
    reasons = np.array(
        [
            f"residuals follow each other (lag-1 {each:.3f}): signals look smoothed, or the curve is not Equation 2; "
            "beta then reflects the filter, not the tyre"
            for each in rho
        ]
    )
    return [(checked & (reasons == which), str(which)) for which in np.unique(reasons[checked])]


@jax.jit
def _lag_1_of_residuals(
    d: Float[Array, "records points"],
    F: Float[Array, "records points"],
    used: Bool[Array, "records points"],
    value: Float[Array, "records 5"],
) -> Float[Array, " records"]:
    return jax.vmap(lag_1)(_residuals(d, F, value), used)


@jax.jit
def _residuals_and_tangents(
    d: Float[Array, "records points"],
    F: Float[Array, "records points"],
    used: Bool[Array, "records points"],
    value: Float[Array, "records 5"],
) -> tuple[Float[Array, "records points"], Float[Array, "records points 4"]]:
    del used
    k, c, beta, d_i, F_i = (value[:, i] for i in (K, C, BETA, D_I, F_I))
    tangents = jax.vmap(curve_tangents)(d - d_i[:, None], k, k * d_i + c - F_i, beta)
    return _residuals(d, F, value), tangents


def _residuals(
    d: Float[Array, "records points"], F: Float[Array, "records points"], value: Float[Array, "records 5"]
) -> Float[Array, "records points"]:
    k, c, beta, d_i, F_i = (value[:, i, None] for i in (K, C, BETA, D_I, F_I))
    return F - equation_2(d, k=k, C=c, beta=beta, d_i=d_i, F_i=F_i)
