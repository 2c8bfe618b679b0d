"""The method `inertia`: unsmoothed, force on the tyre = applied load - m d'' - c d', up to the first reversal."""

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.record import MASS, MASS_SD, Samples
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2
from bayes_tyre.signals.flat_ground import to_flat_ground
from bayes_tyre.signals.integrate import MM_PER_M, Path, anchored_path
from bayes_tyre.signals.mass import Mass, Motion, find_mass
from bayes_tyre.signals.processed import Processed, Recording, clarity

# The path begins so long before the acceleration leaves its noise, s: the axle has not moved by 1 um yet.
_MARGIN_S = 3e-3
# The mass is sought in so much of the ringing after the ramp, s: later the integrated displacement wanders.
_RINGING_S = 0.25
#: A branch with fewer points says nothing of three parameters.
LEAST_POINTS = 10
#: Laser and accelerometer may part by so many standard deviations of their difference, or by so much of the travel.
SENSORS_APART, SENSORS_APART_SHARE = 6.0, 0.15
#: The record's own mass and the rig file's may differ by so many standard deviations of both...
MASS_APART = 3.0
#: ...to which levers, calibration and the shape of the friction add so much of the rig file's.
_MASS_OFF = 0.05


def inertia(recording: Recording, rig: Rig) -> Processed:
    """Return the loading or unloading branch of a recording.

    Displacement: the acceleration integrated twice, held by the laser (`integrate`), at the wheel centre (Eq. 5, 6).
    Force: the converted load and the axle's own, less mass times acceleration and damping times velocity (`mass`),
    sample by sample. Both on flat ground (Eq. 7 to 10, `flat_ground`). The first point is the rest before the step,
    with the small uncertainty of its mean; the last is the first reversal.

    Why the damping: left in, its force, 0.2 kN at 3 % of critical, bends the path by as much as friction does. On 24
    simulated records least squares of Eq. 2 then took the bend for a beta beyond the travel in a quarter of them.

    Raises
    ------
    BadInput
        If laser and accelerometer do not agree; if the motion does not follow the load, or follows it as another mass
        would; or if too few samples lie on the branch.
    """
    step, signals = recording.step, recording.signals
    dt_s = signals.dt_s
    first = max(step.pre_step, min(step.start, step.onset - round(_MARGIN_S / dt_s)))
    path = anchored_path(signals, step, first)
    _check_sensors(path)
    motion = _at_wheel_centre(rig, path, signals.load_kN)
    used = round((step.ramp.end_s + _RINGING_S) / dt_s) - first
    mass = find_mass(rig, Motion(*(values[:used] for values in motion)), dt_s)
    _check_mass(mass, rig, recording)
    force = motion.applied_kN - mass.kg * KN_PER_KG_MM_PER_S2 * motion.acceleration_mm_per_s2
    force -= mass.damping_kN_s_per_mm * motion.velocity_mm_per_s
    end = _first_reversal(motion.velocity_mm_per_s, step.sign, round(step.ramp.end_s / dt_s) - first)
    if end < LEAST_POINTS:
        raise BadInput(
            f"motion turns after {end * dt_s:.3g} s, {end} samples; {LEAST_POINTS} are needed: check the sign of the "
            "acceleration in [signs] of the rig file, or record at a higher rate"
        )
    force[0] = float(geometry.tyre_load(rig, step.load.mean))
    flat = to_flat_ground(rig, motion.displacement_mm[:end], force[:end], step.load.mean)
    force_sd = np.full(end, _force_sd(rig, recording, mass))
    force_sd[0] = step.load.standard_error * float(geometry.wheel_centre_force(rig, 1.0))
    to_flat = np.gradient(flat.displacement_mm, motion.displacement_mm[:end] + np.arange(end) * 1e-12 * step.sign)
    per_kg = -(motion.acceleration_mm_per_s2 * KN_PER_KG_MM_PER_S2 + mass.damping_per_kg * motion.velocity_mm_per_s)
    per_kg[0] = 0.0  # the rest before the step, whose force needs no mass
    lever = float(geometry.wheel_centre_displacement(rig, 1.0))
    return Processed(
        recording.factors,
        signals.time_s[first : first + end],
        flat.displacement_mm,
        flat.force_kN,
        path.displacement_sd_mm[:end] * lever * np.clip(np.abs(np.nan_to_num(to_flat, nan=1.0)), 0.5, 1.0),
        force_sd * flat.per_wheel_centre,
        {**clarity(step), **_extras(recording, mass, path, flat.start_mm)},
        recording,
        per_kg[:end] * flat.per_wheel_centre,
    )


def _at_wheel_centre(rig: Rig, path: Path, load_kN: Samples) -> Motion:
    ratio = float(geometry.wheel_centre_displacement(rig, 1.0))
    applied = np.asarray(geometry.tyre_load(rig, load_kN[path.first : path.first + len(path.displacement_mm)]), float)
    return Motion(
        path.displacement_mm * ratio, path.velocity_mm_per_s * ratio, path.acceleration_mm_per_s2 * ratio, applied
    )


def _check_sensors(path: Path) -> None:
    """Reject a record whose displacements differ by more than noise and calibration explain: one of them is wrong."""
    apart, sd = path.laser_less_accelerometer_mm, float(np.hypot(path.accelerometer_sd_mm, path.laser_sd_mm))
    if abs(apart) > max(SENSORS_APART * sd, SENSORS_APART_SHARE * abs(path.laser_mm)):
        raise BadInput(
            f"laser says {path.laser_mm:.3g} mm of travel, accelerometer {path.laser_mm - apart:.3g} +- {sd:.2g} mm: "
            "check units, signs and calibration of both in the rig file"
        )


def _check_mass(mass: Mass, rig: Rig, recording: Recording) -> None:
    """Reject a record whose motion asks for a mass that the axle cannot have; k would be wrong by as much.

    Of a rolling tyre that is the runout: what it does to the friction before the step it does not do during it, so
    taking the one from the other leaves up to the friction's force, and that looks like mass. `docs/validation.md` says
    how many records of the simulated test plan this finds, and what k the others have.
    """
    kg = rig.axle.effective_mass_kg
    sd_kg = float(np.hypot(kg * np.hypot(rig.axle.effective_mass_relative_sd, _MASS_OFF), mass.record_sd_kg))
    if abs(mass.record_kg - kg) <= MASS_APART * sd_kg:
        return
    cause = "mend the calibration of accelerometer or load, "
    if recording.factors.case.speed_km_h > 0:
        cause = f"the runout of {recording.runout_rms_m_per_s2:.2g} m/s^2 cannot be told from the step, "
    raise BadInput(
        f"motion follows the load as a mass of {mass.record_kg:.3g} kg would, {abs(mass.record_kg - kg) / sd_kg:.2g} "
        f"standard deviations from the rig file's {kg:.3g} kg: {cause}or mend effective_mass_kg or its relative_sd"
    )


def _first_reversal(velocity: Samples, sign: int, ramp_end: int) -> int:
    """Return how many samples the motion goes the way of the load, from before its fastest to where it turns."""
    forward = sign * velocity
    fastest = int(np.argmax(forward[: max(2, ramp_end)]))
    turned = np.flatnonzero(forward[fastest:] <= 0)
    return fastest + int(turned[0]) if len(turned) and forward[fastest] > 0 else 0


def _force_sd(rig: Rig, recording: Recording, mass: Mass) -> float:
    """Return the noise of a sample of the force at the wheel centre, kN."""
    step = recording.step
    load = step.load.sample_sd * float(geometry.wheel_centre_force(rig, 1.0))
    acceleration = step.acceleration.sample_sd * MM_PER_M * float(geometry.wheel_centre_displacement(rig, 1.0))
    return float(np.hypot(load, mass.kg * KN_PER_KG_MM_PER_S2 * acceleration))


def _extras(recording: Recording, mass: Mass, path: Path, start_mm: float) -> dict[str, float | str]:
    return {
        MASS: mass.kg,
        MASS_SD: mass.sd_kg,
        "mass_from_record_kg": mass.record_kg,
        "mass_from_record_sd_kg": mass.record_sd_kg,
        "damping_kN_s_per_mm": mass.damping_kN_s_per_mm,
        "laser_less_accelerometer_mm": path.laser_less_accelerometer_mm,
        "accelerometer_sd_mm": path.accelerometer_sd_mm,
        "rest_displacement_mm": start_mm,
        "runout_rms_m_per_s2": recording.runout_rms_m_per_s2,
        "method": "inertia",
    }
