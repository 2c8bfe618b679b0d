"""The mass that moves: from the rig file and one record's motion, and from the records of a rig together."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear, minimize_scalar

from bayes_tyre.record import means_of_blocks
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

Samples = Float[np.ndarray, "..."]
# Fitted on means over 1 ms: the noise of the load is as good, and the recursion of the friction is short.
_MEAN_S = 1e-3
#: Displacements over which friction may turn, mm: the best is sought about the best of these.
_TURNS_MM = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
# It is found to within 1 % of itself, a tenth of its standard error or less.
_TURN_FOUND = {"xatol": 0.01}
# Turns so much longer and shorter show what an error of the turn does.
_NEARBY = 1.05
# Of the design: mass, damping, stiffness, friction, the state it begins in, level.
_COLUMNS = 6
# Standard deviation of the mass between records, as a share of the rig file's, above which they do not share one.
_MOST_BETWEEN = 0.05
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
    damping_per_kg:
        By how much the damping that fits best grows with the mass, kN s/mm/kg.
    """

    kg: float
    sd_kg: float
    record_kg: float
    record_sd_kg: float
    damping_kN_s_per_mm: float
    damping_per_kg: float


def find_mass(rig: Rig, motion: Motion, dt_s: float) -> Mass:
    """Return mass and damping at the wheel centre, from step and ring-down together with what is known before.

    Least squares of ``applied = m d'' + c d' + k d + friction + constant``. All that is noisy to speak of is the
    applied load, on the left; so the right side may stand as measured. Friction turns with the motion over some
    displacement, which is fitted too (Dahl's element, which a sign of the velocity is the limit of), from a state that
    the record begins in. The residuals' autocorrelation widens the standard errors: noise that is slow says less. Known
    before: the rig file's mass, as well as it says; and that damping is a few per cent of critical, which matters only
    where runout or noise hide it.

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
    d, v, a, applied = (means_of_blocks(values, length) for values in motion)

    def design(turn_mm: float) -> Samples:
        return np.stack([a * KN_PER_KG_MM_PER_S2, v, d, *_friction(d, turn_mm), np.ones_like(d)], axis=1)

    turn_mm = _best_turn(lambda turn_mm: _squares(design(turn_mm), applied))
    columns = design(turn_mm)
    alone = _least_squares(columns, applied)
    variance = _noise_variance(applied - columns @ alone, columns.shape[1] + 1)
    # The turn's own column, in which its error reaches those of the others.
    longer, shorter = (np.stack(_friction(d, turn_mm * factor), axis=1) for factor in (_NEARBY, 1 / _NEARBY))
    columns_of_errors = np.column_stack([columns, (longer - shorter) @ alone[3:5]])
    before = _known_before(rig, float(alone[2]), variance)
    both = _least_squares(
        np.concatenate([columns, before[:, :-1]]), np.append(applied, [before[0, 0] * rig.axle.effective_mass_kg, 0.0])
    )
    of_record = variance * _inverse(columns_of_errors)
    of_both = variance * _inverse(np.concatenate([columns_of_errors, before]))
    sd_kg, record_sd_kg = np.sqrt(of_both[0, 0]), np.sqrt(of_record[0, 0])
    values = both[0], sd_kg, alone[0], record_sd_kg, both[1], of_both[0, 1] / of_both[0, 0]
    return Mass(*map(float, values))


def shared_mass(rig: Rig, records: Float[np.ndarray, "records 2"]) -> tuple[float, float] | None:
    """Return the mass (kg) that all records of a rig share, and its standard deviation; None where they share none.

    Records differ by more than their standard errors where friction or runout is not as `find_mass` has it: a variance
    between records (DerSimonian & Laird, Controlled Clinical Trials 7, 1986) is added to each. The rig file's mass
    counts once. Records that differ by more than 5 % have no mass in common: other ballast, or runout that hides it.

    Parameters
    ----------
    rig:
        Mass of the rig file and how well it is known.
    records:
        The mass that each record asks for by itself, kg, and its standard deviation.
    """
    kg, sd_kg = records.T
    weight = 1.0 / sd_kg**2
    total = weight.sum()
    excess = float(weight @ (kg - weight @ kg / total) ** 2) - (len(kg) - 1)
    between = max(0.0, excess / (total - weight @ weight / total)) if len(kg) > 1 else 0.0
    if between**0.5 > _MOST_BETWEEN * rig.axle.effective_mass_kg:
        return None
    known_sd = max(rig.axle.effective_mass_relative_sd, 1e-9) * rig.axle.effective_mass_kg
    precision = np.append(1.0 / (sd_kg**2 + between), known_sd**-2)
    mean = precision @ np.append(kg, rig.axle.effective_mass_kg) / precision.sum()
    return float(mean), float(precision.sum() ** -0.5)


def _best_turn(squares: Callable[[float], float]) -> float:
    """Return the displacement over which friction turns, mm, with the least squares."""
    tried = np.log(_TURNS_MM)
    best = int(np.argmin([squares(turn_mm) for turn_mm in _TURNS_MM]))
    about = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
    minimum = minimize_scalar(lambda x: squares(float(np.exp(x))), bounds=about, method="bounded", options=_TURN_FOUND)
    return float(np.exp(minimum.x))


def _known_before(rig: Rig, stiffness: float, variance: float) -> Samples:
    """Return the rows of the design in which the rig file's mass, and a damping of about none, weigh as they say."""
    mass = rig.axle.effective_mass_kg
    critical = 2 * float(np.sqrt(max(stiffness, 1e-3) * mass * KN_PER_KG_MM_PER_S2))
    noise = np.sqrt(max(variance, 1e-18))
    rows = np.zeros((2, _COLUMNS + 1))
    rows[0, 0] = noise / (mass * max(rig.axle.effective_mass_relative_sd, 1e-9))
    rows[1, 1] = noise / (_DAMPING_RATIO * critical)
    return rows


def _least_squares(design: Samples, applied: Samples) -> Samples:
    """Return the coefficients: neither mass, damping, stiffness nor friction is negative; the others may be."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    low = np.array([0.0, 0.0, 0.0, 0.0, -np.inf, -np.inf])
    return lsq_linear(design / scale, applied, (low, np.full(len(low), np.inf))).x / scale


def _squares(design: Samples, applied: Samples) -> float:
    return float(np.sum((applied - design @ _least_squares(design, applied)) ** 2))


def _noise_variance(residual: Samples, parameters: int) -> float:
    """Return the variance of the residuals, widened for their autocorrelation."""
    squares = float(residual @ residual)
    alike = min(max(float(residual[1:] @ residual[:-1]) / max(squares, 1e-30), 0.0), 0.95)
    return squares / max(len(residual) - parameters, 1) * (1 + alike) / (1 - alike)


def _inverse(design: Samples) -> Samples:
    """Return the inverse of the normal matrix of a design, of which some columns may be zero."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    scaled = design / scale
    return np.linalg.pinv(scaled.T @ scaled) / np.outer(scale, scale)


def _friction(d: Samples, turn_mm: float) -> tuple[Samples, Samples]:
    """Return Dahl's element along a path, from 0 and for unit friction, and what remains of the state it begins in."""
    friction = np.zeros(len(d))
    moves = np.diff(d)
    keep = np.exp(-np.abs(moves) / turn_mm)
    drive = np.sign(moves) * (1 - keep)
    for i in range(len(moves)):
        friction[i + 1] = friction[i] * keep[i] + drive[i]
    return friction, np.append(1.0, np.cumprod(keep))
