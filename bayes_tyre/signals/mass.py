"""The mass that moves, from what the rig file says and from the record's own motion."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2
from bayes_tyre.signals.noise import block_means

Samples = Float[np.ndarray, "..."]
# Fitted on means over 1 ms: the noise of the load is as good, and the recursion of the friction is short.
_MEAN_S = 1e-3
#: Displacements over which friction may turn, mm; the one that fits best is taken.
_TURNS_MM = (0.02, 0.04, 0.08, 0.16, 0.32)
# What is known of viscous damping before a record says more: standard deviation about none, as a share of critical.
_DAMPING_RATIO = 0.06


class Motion(NamedTuple):
    """Motion and applied force of the wheel centre, down positive, shape (samples,) each: mm, mm/s, mm/s^2, kN."""

    displacement_mm: Samples
    velocity_mm_per_s: Samples
    acceleration_mm_per_s2: Samples
    applied_kN: Samples


class Mass(NamedTuple):
    """The mass and the damping that move with it.

    Attributes
    ----------
    kg, sd_kg:
        Record and rig file, weighted by their precision.
    record_kg, record_sd_kg:
        From the record alone.
    damping_kN_s_per_mm:
        Viscous damping at the wheel centre.
    """

    kg: float
    sd_kg: float
    record_kg: float
    record_sd_kg: float
    damping_kN_s_per_mm: float


class _Fit(NamedTuple):
    variance: float
    values: Samples
    sds: Samples


def find_mass(rig: Rig, motion: Motion, dt_s: float) -> Mass:
    """Return mass and damping at the wheel centre, from step and ring-down together with what is known before.

    Least squares of ``applied = m d'' + c d' + k d + friction + constant``. All that is noisy to speak of is the
    applied load, on the left; so the right side may stand as measured. Friction turns with the motion over some
    displacement (Dahl's element, which a sign of the velocity is the limit of) from a state that the record begins in.
    The residuals' autocorrelation widens the standard errors: noise that is slow says less. Known before: the rig
    file's mass, as well as it says; and that damping is a few per cent of critical, which matters only where runout or
    noise hide it.

    Parameters
    ----------
    rig:
        Mass of the rig file and how well it is known.
    motion:
        From rest through the step and some ringing.
    dt_s:
        Spacing of the samples, s.
    """
    length = max(1, round(_MEAN_S / dt_s))
    d, v, a, applied = (block_means(values, length) for values in motion)
    fits = []
    for turn_mm in _TURNS_MM:
        design = np.stack([a * KN_PER_KG_MM_PER_S2, v, d, *_friction(d, turn_mm), np.ones_like(d)], axis=1)
        fits.append((_fit(design, applied), design))
    alone, design = min(fits, key=lambda fit: fit[0].variance)
    mass, mass_sd = rig.axle.effective_mass_kg, rig.axle.effective_mass_kg * rig.axle.effective_mass_relative_sd
    stiffness = max(float(alone.values[2]), 1e-3)
    damping_sd = _DAMPING_RATIO * 2 * float(np.sqrt(stiffness * mass * KN_PER_KG_MM_PER_S2))
    rows = np.zeros((2, design.shape[1]))
    noise = np.sqrt(max(alone.variance, 1e-18))
    rows[0, 0], rows[1, 1] = noise / max(mass_sd, 1e-9 * mass), noise / damping_sd
    both = _fit(np.concatenate([design, rows]), np.append(applied, [rows[0, 0] * mass, 0.0]), alone.variance)
    return Mass(*map(float, (both.values[0], both.sds[0], alone.values[0], alone.sds[0], both.values[1])))


def _fit(design: Samples, applied: Samples, variance: float | None = None) -> _Fit:
    """Return coefficients and standard errors; the residuals' variance, for autocorrelation widened, if not given."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    scaled = design / scale
    # Neither mass, damping, stiffness nor friction is negative; the state it begins in and the level may be.
    low = np.array([0.0, 0.0, 0.0, 0.0, -np.inf, -np.inf])
    values = lsq_linear(scaled, applied, (low, np.full(len(low), np.inf))).x
    if variance is None:
        residual = applied - scaled @ values
        squares = float(residual @ residual)
        alike = min(max(float(residual[1:] @ residual[:-1]) / max(squares, 1e-30), 0.0), 0.95)
        variance = squares / max(len(applied) - len(low), 1) * (1 + alike) / (1 - alike)
    sds = np.sqrt(np.diag(np.linalg.pinv(scaled.T @ scaled)) * variance)
    return _Fit(variance, values / scale, sds / scale)


def _friction(d: Samples, turn_mm: float) -> tuple[Samples, Samples]:
    """Return Dahl's element along a path, from 0 and for unit friction, and what remains of the state it begins in."""
    friction = np.zeros(len(d))
    moves = np.diff(d)
    keep = np.exp(-np.abs(moves) / turn_mm)
    drive = np.sign(moves) * (1 - keep)
    for i in range(len(moves)):
        friction[i + 1] = friction[i] * keep[i] + drive[i]
    return friction, np.append(1.0, np.cumprod(keep))
