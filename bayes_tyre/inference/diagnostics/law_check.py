"""Whether the other law along a record fits the records better than the law of the posterior.

Both have the same parameters, and to first order beta takes up what they differ by: only refits tell them apart. Errors
of the displacement are known to the likelihood to first order, and what that leaves out may favour one law whichever is
true: what the other law gains is held against what it gains on records simulated from the law of the posterior, by
whichever of the two gains scatters more.

Source: Vuong (1989), the test of two models neither of which contains the other; Cox (1961), a gain held against what
it is where one of them is true.
"""

from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy import signal

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import whiten
from bayes_tyre.inference.diagnostics.course_checks import STANDARD_ERRORS_MOST
from bayes_tyre.inference.diagnostics.residuals import Residuals
from bayes_tyre.inference.diagnostics.sampling_checks import Check, unchecked
from bayes_tyre.inference.lack_of_fit import WAVE_POINTS
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.noise.converter_steps import UNIFORM_SD, converter_step_mm
from bayes_tyre.inference.model.noise.heavy_tails import estimated_heavy_tails
from bayes_tyre.inference.model.prepared_records import with_noise
from bayes_tyre.inference.record_data import LAWS, force_curves
from bayes_tyre.record import EITHER_LAW

#: Residuals below this part of the change of force are rounding.
_EXACT = 1e-6
#: Records whose log beta has a standard error above this do not say which law they follow.
_SD_LOG_BETA = 0.3
#: Fewest records whose scatter says how certain their sum is.
_LEAST_RECORDS = 12
#: How many times all records are simulated.
_SIMULATED = 4


class LawFit(NamedTuple):
    """Least squares of each record with one law.

    Attributes
    ----------
    log_likelihood:
        Shape (records,): of its points, each record's own variance the likeliest; but for what all laws share.
    log_beta, sd_log_beta:
        Shape (records,): its estimate (beta in mm) and standard error.
    """

    log_likelihood: Float[np.ndarray, " records"]
    log_beta: Float[np.ndarray, " records"]
    sd_log_beta: Float[np.ndarray, " records"]


def law_check(of_records: Residuals) -> Check:
    """Return whether the other law along a record fits the records better, each by its own least squares.

    Records that hardly determine beta say nothing of it.
    """
    law = of_records.model.law
    other = next(name for name in LAWS if name != law)
    own_fit, other_fit = (refitted(of_records, of_records.measured, name) for name in (law, other))
    sound = of_records.batch.points >= WAVE_POINTS
    sound &= np.maximum(own_fit.sd_log_beta, other_fit.sd_log_beta) < _SD_LOG_BETA
    gain = (other_fit.log_likelihood - own_fit.log_likelihood)[sound]
    if len(gain) < _LEAST_RECORDS:
        return unchecked("law", STANDARD_ERRORS_MOST, f"fewer than {_LEAST_RECORDS} records determine their beta")
    sd = float(np.sqrt(np.sum((gain - gain.mean()) ** 2)))
    value = float(gain.sum()) / sd if sd > 0 else 0.0
    if value > STANDARD_ERRORS_MOST and of_records.displacement_sd_mm.any():
        by_error = _gains_if_true(of_records, other)[:, sound]
        sd = max(sd, float(np.sqrt(by_error.var(axis=1).mean() * len(gain))))
        value = float(gain.sum() - max(by_error.sum(axis=1).mean(), 0.0)) / sd
    finding = f"beta: the records follow {other} rather than {law}, by {value:.1f} standard errors"
    note = ""
    if abs(value) <= STANDARD_ERRORS_MOST:
        ratio = np.exp(np.median((other_fit.log_beta - own_fit.log_beta)[sound]))
        note = f"{EITHER_LAW}{law} from {other}, with which it is {ratio:.2f} times as large"
    passed = value <= STANDARD_ERRORS_MOST
    return Check("law", "model", passed, value, STANDARD_ERRORS_MOST, "beta", finding, f"fit with --law {other}", note)


def refitted(of_records: Residuals, measured: Batch, law: str) -> LawFit:
    """Return the least squares of records with a law, their noise as the posterior has it.

    Noise near the start that was found in residuals about one law is left out: it may be what the law is off.

    Parameters
    ----------
    of_records:
        What the posterior says of them.
    measured:
        The records as they were measured, or others in their place.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """
    model, rho, nu = of_records.model, of_records.rho, of_records.noise_nu
    alike = replace(model, law=law, noise=model.correlation)
    batch, whitening, *_ = with_noise(measured, of_records.of_record, alike)
    if nu is not None:
        whitening = estimated_heavy_tails(batch, law, nu)
    estimates = estimate_records(batch, "iid" if rho is None else "ar1", whitening, law=law)
    u = batch.displacement_mm - batch.displacement_mm[:, :1]
    curve = np.asarray(force_curves(jnp.asarray(u), estimates.centre, law))
    residual = np.where(batch.present, batch.force_kN - curve, 0.0)
    if nu is None:
        square = np.sum(whiten(residual, batch.present, rho, whitening) ** 2, axis=1)
        volume = 0.0 if whitening is None else np.asarray(whitening.log_volume(jnp.asarray(batch.points)))
        log_likelihood = volume - 0.5 * batch.points * np.log(square + (_EXACT * of_records.span) ** 2)
    else:
        log_likelihood = _heavy_tailed(residual, batch.present, np.exp(np.asarray(estimates.log_sigma)), nu)
    variance = np.linalg.inv(np.asarray(estimates.information))[:, 3, 3]
    return LawFit(log_likelihood, np.asarray(estimates.log_beta), np.sqrt(variance))


def _heavy_tailed(
    residual: Float[np.ndarray, "records points"],
    present: Bool[np.ndarray, "records points"],
    sigma_kN: Float[np.ndarray, " records"],
    nu: float,
) -> Float[np.ndarray, " records"]:
    """Return the log likelihood of residuals as Student-t noise, but for a constant of each record."""
    scale = np.where(present, np.log(sigma_kN)[:, None], 0.0)
    return np.sum(-scale - 0.5 * (nu + 1.0) * np.log1p((residual / sigma_kN[:, None]) ** 2 / nu), axis=1)


def _gains_if_true(of_records: Residuals, other: str) -> Float[np.ndarray, "simulated records"]:
    """Return what the other law gains on records simulated from the law of the posterior, several times over."""

    def gain(seed: int) -> Float[np.ndarray, " records"]:
        made = simulated(of_records, seed)
        own_fit, other_fit = (refitted(of_records, made, law) for law in (of_records.model.law, other))
        return other_fit.log_likelihood - own_fit.log_likelihood

    return np.stack([gain(seed) for seed in range(_SIMULATED)])


def simulated(of_records: Residuals, seed: int) -> Batch:
    """Return records along the paths of those measured, with the means of their posterior, its noise and displacements.

    The error of a mass is one of each record, as the model has it. Noise that is larger near the start is left out, as
    `refitted` leaves it out: it was found about one law, and may be what that law is off.
    """
    rng, measured, present = np.random.default_rng(seed), of_records.measured, of_records.measured.present
    shape, curve = present.shape, of_records.batch.force_kN - of_records.residual_kN
    noise = rng.standard_normal(shape)
    if of_records.rho is not None:
        for each, rho in zip(noise, of_records.rho, strict=True):
            each[1:] *= np.sqrt(1.0 - rho**2)
            each[:] = signal.lfilter([1.0], [1.0, -rho], each)
    step_mm = converter_step_mm(measured)[:, None]
    before = np.sqrt(np.maximum(of_records.displacement_sd_mm[:, None] ** 2 - (UNIFORM_SD * step_mm) ** 2, 0.0))
    displacement = of_records.batch.displacement_mm + before * rng.standard_normal(shape)
    # Where a path lies between two steps of the converter is not known: it is drawn, once a record.
    phase, step = rng.uniform(size=step_mm.shape), np.where(step_mm > 0, step_mm, 1.0)
    displacement = np.where(step_mm > 0, step * np.round(displacement / step + phase), displacement)
    force = curve + of_records.sigma_kN[:, None] * noise
    if measured.force_error_kN is not None:
        force = force + measured.force_error_kN * rng.standard_normal((len(force), 1))
    displacement, force = (np.where(present, values, values[:, :1]) for values in (displacement, force))
    return replace(measured, displacement_mm=displacement, force_kN=force)
