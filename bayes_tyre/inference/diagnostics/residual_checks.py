"""Checks of a posterior against the points of its records: whether the curve and the noise are as the model has them.

Each looks at one way in which a model that is wrong leaves its intervals too narrow or in the wrong place. Residuals
are taken at the posterior means, whitened by the model's own noise, and what a record's own F_i, J, k and beta can
take up is left out of them. Their limits let all checks together fail in less than one of a hundred data sets that
follow the model.
"""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.correlated_noise import SMOOTHED
from bayes_tyre.inference.diagnostics.course_checks import CHANCE, STANDARD_ERRORS_MOST, WRONG_LAW, course_checks
from bayes_tyre.inference.diagnostics.law_check import law_check
from bayes_tyre.inference.diagnostics.residuals import Residuals, residuals
from bayes_tyre.inference.diagnostics.sampling_checks import Check, unchecked
from bayes_tyre.inference.lack_of_fit import CURVE_PARAMETERS, MISFIT_MOST, WAVE_POINTS, misfit
from bayes_tyre.inference.noise_along_path import NEAR_BETAS, directions, freedom, near_start, variance_ratio

#: Lag-1 autocorrelation of residuals up to which intervals are off by a tenth of their width at most: of k and beta
#: they are narrow by (1 + rho) / (1 - rho), square root.
AUTOCORRELATION_MOST = 0.1
#: Ratio of variances along a record up to which intervals of beta are off by a fifth of their width at most.
UNEVEN_MOST = 1.5
#: Part of the points of a record that are its first, whatever beta.
_FIRST = 0.2
#: A k estimated without the hierarchy is negative from so many standard errors on, in one record of many.
_NEGATIVE = 4.0
#: Standard deviations of the noise that a record's residuals have in the mean square where the posterior is not of it.
_FAR = 3.0
_TOO_FEW = f"fewer than {WAVE_POINTS} points do not tell noise from another curve"
_AR1 = "fit with --noise auto or ar1, or with unsmoothed signals"
_UNSMOOTHED = "the noise is no AR(1): use unsmoothed signals, or fewer points of each record"
_RAW = "the signals look smoothed, and beta then reflects the filter: no noise model helps, use the raw ones"
_UNEVEN = (
    "beta's intervals are off by about its root: fit with --noise auto, or give the displacement's error as "
    "--displacement-sd (mm), or use readings of finer steps of displacement, or unfiltered ones"
)


def residual_checks(tree: xr.DataTree, table: pd.DataFrame) -> list[Check]:
    """Return the checks of the residuals of every record.

    Parameters
    ----------
    tree:
        A posterior of records, as `bayes_tyre.inference.sampling.datatree.to_datatree` gives it.
    table:
        The points that it was fitted to.
    """
    of_records = residuals(tree, table)
    posterior = tree["posterior"].to_dataset().sel(record=list(of_records.batch.records))
    return [
        _autocorrelation(of_records),
        _record_curves(of_records),
        *course_checks(of_records, posterior),
        law_check(of_records),
        _uneven_noise(of_records),
        _negative_stiffness(of_records),
        *_displacement_errors(of_records, posterior, given=of_records.model.displacement_sd is not None),
        *_mass_error(of_records),
    ]


def _autocorrelation(of_records: Residuals) -> Check:
    """Return whether residuals follow each other, more than chance and enough to narrow intervals.

    Noise that the model lets follow itself may do so, but not as signals do that were smoothed.
    """
    typical = 0.0 if of_records.rho is None else float(np.median(of_records.rho))
    if typical > SMOOTHED:
        finding = f"sigma: the noise has lag-1 autocorrelation {typical:.3f}"
        return Check("residual_autocorrelation", "model", False, typical, SMOOTHED, "sigma", finding, _RAW)
    basis = directions(of_records.whitened(of_records.tangents()))
    left = of_records.white_kN - np.einsum("rpc,rc->rp", basis, np.einsum("rpc,rp->rc", basis, of_records.white_kN))
    spare = of_records.batch.points - CURVE_PARAMETERS
    # What is left of white noise has neighbours against each other, by the products of what was taken out.
    by_chance = -np.einsum("rpc,rpc->r", basis[:, 1:], basis[:, :-1])
    each = np.sum(left[:, 1:] * left[:, :-1], axis=1) / np.sum(left**2, axis=1)
    value = float((each * spare - by_chance).sum() / spare.sum())
    most = AUTOCORRELATION_MOST + STANDARD_ERRORS_MOST / np.sqrt(spare.sum())
    finding = f"sigma: residuals have lag-1 autocorrelation {value:.2f}: intervals are too narrow"
    remedy = _RAW if value > SMOOTHED else _AR1 if of_records.rho is None else _UNSMOOTHED
    return Check("residual_autocorrelation", "model", bool(value <= most), value, float(most), "sigma", finding, remedy)


def _record_curves(of_records: Residuals) -> Check:
    """Return whether each record by itself follows its curve: the rule of `lsq`, for as many records as there are.

    Records of too few points to say are named as not checked, though others were.
    """
    batch, records = of_records.batch, len(of_records.batch.records)
    tangents = jnp.asarray(of_records.whitened(of_records.tangents()))
    misfits = misfit(of_records.white_kN, tangents, batch.present, batch.force_kN)
    # What a record's own parameters take up is no misfit of the law; but a posterior must be near them.
    far = np.sqrt(np.sum(of_records.white_kN**2, axis=1) / batch.points) > _FAR * of_records.sigma_kN
    wrong = misfits.wrong_curve(CHANCE / records) | far
    unjudged = misfits.unjudged & ~wrong
    first = batch.records[int(np.argmax(unjudged))]
    too_few = f"{unjudged.sum()} of {records} records, first {first}: {_TOO_FEW}"
    if unjudged.all():
        return unchecked("record_curves", MISFIT_MOST, too_few)
    worst = int(np.argmax(np.where(wrong, misfits.share, -1.0)))
    where = batch.records[worst] if wrong.any() else ""
    value = float(misfits.share[wrong].max()) if wrong.any() else 0.0
    finding = (
        f"{where}: off its curve by {value:.1%} of the change of force, more than noise explains"
        f"{f' ({wrong.sum() - 1} more records)' if wrong.sum() > 1 else ''}"
    )
    check = Check("record_curves", "model", not bool(wrong.any()), value, MISFIT_MOST, where, finding, WRONG_LAW)
    return check._replace(not_checked=too_few) if unjudged.any() else check


def _uneven_noise(of_records: Residuals) -> Check:
    """Return whether the noise is as large near the start, where beta shows, as on the rest of the way.

    Where points share errors, residuals near the start may be smaller than the noise: only larger ones are off.
    """
    present, points = of_records.batch.present, of_records.batch.points
    square = (of_records.white_kN / of_records.sigma_kN[:, None]) ** 2
    left = freedom(of_records.whitened(of_records.tangents()), present)
    near = near_start(of_records.u, NEAR_BETAS * of_records.means["beta"], present)
    first = present & (np.arange(present.shape[1]) < _FIRST * points[:, None])
    ratios = [variance_ratio(square, left, part) for part in (near, first)]
    off = [each.value if of_records.shared_errors else abs(each.value) for each in ratios]
    surely = [value - STANDARD_ERRORS_MOST * each.error for value, each in zip(off, ratios, strict=True)]
    worst = int(np.argmax(surely))
    value, (log_ratio, error, _) = off[worst], ratios[worst]
    if not np.isfinite(error):
        return unchecked("noise_along_path", UNEVEN_MOST, "too few points near the start of the records, or no noise")
    most = np.log(UNEVEN_MOST) + STANDARD_ERRORS_MOST * error
    passed = bool(value <= most)
    value, limit, times = float(np.exp(value)), float(np.exp(most)), f"{np.exp(log_ratio):.2g}"
    finding = f"sigma: variance of the noise near the start is {times} times that on the rest of the way"
    return Check("noise_along_path", "model", passed, value, limit, "sigma", finding, _UNEVEN, _uneven_note(of_records))


def _uneven_note(of_records: Residuals) -> str:
    """Return what the model takes the noise near the start to be, where it is far from that elsewhere."""
    times = of_records.noise_near_start
    if max(times, 1.0 / times) ** 2 < UNEVEN_MOST:
        return ""
    return f"sigma: near the start of each record the noise is taken as {times:.2g} times as large as elsewhere"


def _negative_stiffness(of_records: Residuals) -> Check:
    """Return whether a record's own k, at the beta of the posterior, is below zero though the model has it above."""
    basis, upper = np.linalg.qr(of_records.whitened(of_records.tangents()[:, :, :3]))
    part = np.einsum("rpc,rp->rc", basis, of_records.white_kN)
    left = of_records.white_kN - np.einsum("rpc,rc->rp", basis, part)
    sigma = np.sqrt(np.sum(left**2, axis=1) / (of_records.batch.points - 3))
    # Of the last column, k: what it explains alone, over its standard error. Where beta leaves nothing to it, no k.
    with np.errstate(divide="ignore", invalid="ignore"):
        change, error = part[:, 2] / upper[:, 2, 2], sigma / np.abs(upper[:, 2, 2])
        errors = np.nan_to_num((of_records.means["k"] + change) / error, nan=np.inf)
    worst = int(np.argmin(errors))
    value, where = float(errors[worst]), of_records.batch.records[worst]
    finding = f"{where}: its own k is negative by {-value:.1f} standard errors: force falls along the envelope"
    remedy = "check the signs and columns of this record, or leave it out"
    passed = value >= -_NEGATIVE
    return Check("sign_of_k", "model", passed, value, -_NEGATIVE, "" if passed else where, finding, remedy)


def _displacement_errors(of_records: Residuals, posterior: xr.Dataset, given: bool) -> Iterator[Check]:
    """Yield whether beta is large enough to show beside errors of the displacement; nothing where there are none.

    Where it is not, its interval is an upper bound: that is said, and fails nothing. So is their size, where it was
    not `given`.
    """
    if not of_records.displacement_sd_mm.any():
        return
    sd_mm = float(np.median(of_records.displacement_sd_mm))
    lower, upper = posterior["beta_case"].quantile([0.025, 0.975], ("chain", "draw")).to_numpy()
    value, open_below = float(lower.min()) / sd_mm, lower < sd_mm
    where = str(posterior["case"].to_numpy()[int(lower.argmin())])
    note = (
        f"beta of {open_below.sum()} cases, first {where}, is an upper bound, {upper[lower.argmin()]:.2g} mm: "
        f"displacements are known to {sd_mm:.2g} mm"
    )
    notes = [note] * bool(open_below.any())
    if not given:
        notes.append(f"displacement: its errors have a standard deviation of {sd_mm:.2g} mm, as the records show")
    note = "; ".join(notes)
    yield Check("displacement_errors", "model", True, value, 1.0, "", "", "", note)


def _mass_error(of_records: Residuals) -> Iterator[Check]:
    """Yield that the error of a mass is left out, where `noise_window` says all of the noise; otherwise nothing."""
    if of_records.model.noise_window > 1 and of_records.measured.force_error_kN is not None:
        note = "k: noise_window says all of the noise, so that the error of the mass (mass_sd_kg) is in no interval"
        yield Check("mass_error", "model", True, np.nan, np.nan, "", "", "", note)
