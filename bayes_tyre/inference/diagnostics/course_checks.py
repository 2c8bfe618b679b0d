"""Checks of a posterior against what the residuals of its records have in common: a course that a wrong law leaves."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float, Int
from scipy import stats

from bayes_tyre.inference.diagnostics.residuals import Residuals
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.lack_of_fit import CURVE_PARAMETERS, WAVES, waves
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.noise_along_path import directions
from bayes_tyre.record import CASE_FACTORS

#: Probability with which a check may fail where the model holds: of nine, less than one in a hundred data sets does.
CHANCE = 1e-3
#: Standard errors beyond which chance brings a value with that probability, to one side.
STANDARD_ERRORS_MOST = float(stats.norm.isf(CHANCE))
#: Fewest degrees of freedom that the scatter among repeats is estimated from.
LEAST_FREEDOM = 6
#: Part of a column that the law's own parameters must leave.
_LEAST_BEYOND = 0.2
WRONG_LAW = "the tyre does not follow the law there: try another --law, and see figures/residuals_against_displacement"


def course_checks(of_records: Residuals, posterior: xr.Dataset) -> Iterator[Check]:
    """Yield whether residuals have a course that records share: along them, and near their start.

    Parameters
    ----------
    of_records:
        The residuals of all records.
    posterior:
        What they are of: it knows which case and direction a record is of.
    """
    batch, case = of_records.batch, case_of_records(posterior)
    spare = int(batch.points.min()) - CURVE_PARAMETERS
    slow = np.asarray(jax.vmap(waves)(jnp.asarray(batch.present)))[:, :, : int(np.clip(spare // 2, 1, WAVES))]
    ratio = np.abs(of_records.u) / of_records.means["beta"][:, None]
    start = np.stack([np.exp(-2.0 * ratio), ratio**2 * np.exp(-ratio)], axis=2)
    groups = _directions(posterior)
    for name, columns, what in (
        ("residual_course", slow, "along their path"),
        ("residuals_at_start", start, "near their start"),
    ):
        value, share, where = _shared_course(of_records, columns, groups, case)
        finding = f"{where or 'records'}: residuals of the records share a course {what}, of {share:.2%} of the force"
        passed = value >= CHANCE
        yield Check(name, "model", passed, value, CHANCE, "" if passed else where, finding, WRONG_LAW)


def _shared_course(
    of_records: Residuals,
    columns: Float[np.ndarray, "records points columns"],
    groups: np.ndarray,
    case: Int[np.ndarray, " records"],
) -> tuple[float, float, str]:
    """Return the probability of the largest mean that residuals have along a column, its size, and of which group.

    Means are held against the scatter of repeats, where it is larger than the noise says: it holds whatever makes one
    record's course unlike the next one's.

    Source: t tests, the smallest of their probabilities times their number (Bonferroni).
    """
    tangents = directions(of_records.whitened(of_records.tangents()))
    courses = _beyond(tangents, of_records.whitened(columns))
    z = np.einsum("rpc,rp->rc", courses, of_records.white_kN) / of_records.sigma_kN[:, None]
    variance, freedom = _variance_about_case(z, case)
    least, share, where = 1.0, 0.0, ""
    labels = list(dict.fromkeys(groups))
    for label in labels:
        own = groups == label
        mean = z[own].mean(axis=0)
        p_value = 2.0 * stats.t.sf(np.abs(mean) * np.sqrt(own.sum() / variance), freedom)
        if p_value.min() < least:
            least, column = float(p_value.min()), int(p_value.argmin())
            size = np.abs(mean[column]) * of_records.sigma_kN[own] / np.sqrt(of_records.batch.points[own])
            share, where = float(np.median(size / of_records.span[own])), str(label)
    return min(least * len(labels) * columns.shape[2], 1.0), share, where


def _beyond(
    tangents: Float[np.ndarray, "records points 4"], columns: Float[np.ndarray, "records points columns"]
) -> Float[np.ndarray, "records points columns"]:
    """Return unit columns for what the law's own parameters cannot take up of each column; 0 where that is little."""
    whole = np.linalg.norm(columns, axis=1, keepdims=True)
    columns = columns / np.where(whole > 0, whole, 1.0)
    left = columns - tangents @ (np.moveaxis(tangents, 1, 2) @ columns)
    size = np.linalg.norm(left, axis=1, keepdims=True)
    # Of what is nearly a tangent, errors of the displacement would be left.
    return np.where(size > _LEAST_BEYOND, left / np.maximum(size, _LEAST_BEYOND), 0.0)


def _variance_about_case(
    z: Float[np.ndarray, "records columns"], case: Int[np.ndarray, " records"]
) -> tuple[Float[np.ndarray, " columns"], float]:
    """Return the variance of z among repeats, at least that of the noise, and its degrees of freedom."""
    repeats = np.bincount(case)
    mean = np.stack([np.bincount(case, column) for column in z.T], axis=1) / np.maximum(repeats, 1)[:, None]
    freedom = len(case) - np.count_nonzero(repeats)
    if freedom < LEAST_FREEDOM:
        return np.ones(z.shape[1]), np.inf
    return np.maximum(np.sum((z - mean[case]) ** 2, axis=0) / freedom, 1.0), float(freedom)


def _directions(posterior: xr.Dataset) -> np.ndarray:
    """Return the direction of each record; one word for all where the table has none."""
    if "record_direction" in posterior.coords:
        return posterior["record_direction"].to_numpy().astype(str)
    return np.full(posterior.sizes["record"], "")


def case_of_records(posterior: xr.Dataset) -> Int[np.ndarray, " records"]:
    """Return which case each record is of."""
    return factors_of_records(posterior).of_record


def factors_of_records(posterior: xr.Dataset) -> Factors:
    """Return the cases of a posterior's records, and how they group; without specimens, days and covariates."""
    factors = {
        name: posterior[f"record_{name}"].to_numpy() for name in CASE_FACTORS if f"record_{name}" in posterior.coords
    }
    return find_factors(pd.DataFrame(factors, index=range(posterior.sizes["record"])))
