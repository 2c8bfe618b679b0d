"""The truth of each record, drawn anew for each axle, case and repeat.

Each draw has a stream of its own, named by what it belongs to: a record is the same in every plan and order. What the
source prints is taken from it; what it does not print is assumed, and a comment says so.
"""

import math

import numpy as np

from bayes_tyre.record import Case
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig, needed
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2
from bayes_tyre.simulate.plan import Planned
from bayes_tyre.simulate.stiffness import case_stiffness
from bayes_tyre.simulate.truth import Harmonic, Runout, Truth

# The laser reads so much in the printed sample, under 30 kN; the axle is then down as this case's stiffness says.
_LASER_AT_30_KN_MM = 661.5
_LASER_CASE = ("unloading", 0.0, 30.0, -10.0)
# Standard deviations of the 27 rows printed in appendix B1 (0.02188 m/s^2, 0.01580 mm, 0.4481 kN), less what the
# converter's steps add to them (step^2 / 12). Taken as white: rows that jump in time tell little else.
_STILL_NOISE = (0.02188, 0.01537, 0.4349)
# Assumed: the source says that the noise grows with speed, and prints no figure.
_NOISE_DOUBLES_AT_KM_H = 20.0
# Assumed: first harmonics of the out-of-roundness of wheel and rollers, mm; axles differ from them by a fifth.
_WHEEL_RUNOUT_MM, _ROLLER_RUNOUT_MM = (0.30, 0.10, 0.05), (0.06, 0.03)
_ROAD_NOISE_MM = 0.005
# Assumed scatter of repeats: relative standard deviations of k, of beta and x, and of the loads.
_K_SD, _FRICTION_SD, _LOAD_SD = 0.01, 0.025, 0.01
# A response of 40 ms, as in the source's unloading example, takes a load that falls in 36 ms. Assumed: 50 ms where the
# cylinder pushes against the tyre, for the source's acceleration spikes are weaker there.
_RISE_TIME_S = {"unloading": 0.036, "loading": 0.050}


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the random numbers that belong to a name, whatever else is drawn from the same seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple("/".join(names).encode())))


def draw_truth(plan: Planned, rig: Rig, seed: int) -> Truth:
    """Return the truth of one record of a plan on a rig; the same record and seed give the same truth.

    Raises
    ------
    BadInput
        If the tyre rolls and the rig file does not say its radius.
    """
    case = plan.case
    draw = stream(seed, "record", plan.label)
    k, beta, x, C, c = _law_and_damping(case, rig, seed, draw)
    ends = (case.initial_load_kN, case.initial_load_kN + case.step_kN)
    load_before, load_after = (load * (1 + _LOAD_SD * _clipped(draw)) for load in ends)
    acceleration, displacement, load = (sd * (1 + case.speed_km_h / _NOISE_DOUBLES_AT_KM_H) for sd in _STILL_NOISE)
    return Truth(
        plan=plan,
        seed=seed,
        k_kN_per_mm=k,
        C_kN=C,
        x_kN=x,
        beta_mm=beta,
        m_kg=_mass(case, rig, seed),
        c_kN_s_per_mm=c,
        # The load came from below, so that the force stands above the middle: the source's unloading steps start
        # steep, and its loading steps hardly do.
        rest_friction_kN=draw.uniform(0.0, 0.95) * (x - k * beta),
        load_before_kN=load_before,
        load_after_kN=load_after,
        step_start_s=draw.uniform(*plan.step_between_s),
        rise_time_s=_RISE_TIME_S[case.direction] * (1 + 0.05 * _clipped(draw)),
        acceleration_offset_m_per_s2=0.013 + 0.01 * _clipped(draw),  # 0.013: mean of the printed rows
        laser_at_first_touch_mm=_laser_at_first_touch(case, rig),
        noise_acceleration_m_per_s2=acceleration,
        noise_displacement_mm=displacement,
        noise_load_kN=load,
        runout=_runout(case, rig, seed, draw) if case.speed_km_h > 0 else Runout(),
    )


def _clipped(rng: np.random.Generator) -> float:
    # Within two standard deviations: then a case's x of 1.6 k beta at least is above 1.3 k beta in every repeat.
    return float(np.clip(rng.standard_normal(), -2.0, 2.0))


def _mass(case: Case, rig: Rig, seed: int) -> float:
    relative = rig.axle.effective_mass_relative_sd * _clipped(stream(seed, "mass", case.configuration))
    return rig.axle.effective_mass_kg * (1 + relative)


def critical_damping(rig: Rig, k: float, m_kg: float) -> float:
    """Return the critical damping of an axle, kN s/mm, by the middle line's slope at the wheel centre, 10 mm down."""
    at_wheel_centre = k * geometry.curvature_factor(rig) * float(geometry.sin_theta(rig, 10.0)) ** 2
    return 2 * math.sqrt(at_wheel_centre * m_kg * KN_PER_KG_MM_PER_S2)


def _law_and_damping(case: Case, rig: Rig, seed: int, draw: np.random.Generator) -> tuple[float, ...]:
    """Return k, beta, x of a repeat, and C, c of its case."""
    tyre, k = stream(seed, "case", case.label), case_stiffness(case)
    # Assumed: beta in 0.045-0.13 mm, x in 0.3-0.6 kN and in 1.6-4 k beta, 2-4 % of critical damping.
    beta = math.exp(tyre.uniform(math.log(max(0.045, 0.32 / (4 * k))), math.log(0.13)))
    x = tyre.uniform(max(0.3, 1.6 * k * beta), min(0.6, 4 * k * beta))
    C = 0.2 * _clipped(tyre)
    c = tyre.uniform(0.02, 0.04) * critical_damping(rig, k, _mass(case, rig, seed))
    k, beta, x = (
        value * (1 + sd * _clipped(draw)) for value, sd in ((k, _K_SD), (beta, _FRICTION_SD), (x, _FRICTION_SD))
    )
    return k, beta, x, C, c


def _runout(case: Case, rig: Rig, seed: int, draw: np.random.Generator) -> Runout:
    axle = stream(seed, "runout", case.configuration)
    mm_per_s = case.speed_km_h / 3.6e-3

    def harmonics(amplitudes: tuple[float, ...]) -> tuple[Harmonic, ...]:
        sizes = [amplitude * (1 + 0.2 * _clipped(axle)) for amplitude in amplitudes]
        return tuple(Harmonic(size, draw.uniform(0, 2 * math.pi)) for size in sizes)

    tyre, rollers = needed(rig.tyre, rig, "tyre"), rig.rollers
    return Runout(
        wheel_turn_Hz=mm_per_s / (2 * math.pi * tyre.unloaded_radius_mm),
        roller_turn_Hz=mm_per_s / (2 * math.pi * rollers.radius_mm) if rollers else 0.0,
        wheel_harmonics=harmonics(_WHEEL_RUNOUT_MM),
        roller_harmonics=harmonics(_ROLLER_RUNOUT_MM) if rollers else (),
        road_noise_mm=_ROAD_NOISE_MM,
    )


def _laser_at_first_touch(case: Case, rig: Rig) -> float:
    down = geometry.wheel_centre_start(rig, 30.0, case_stiffness(Case(case.configuration, *_LASER_CASE)))
    return _LASER_AT_30_KN_MM - down * rig.axle.support_to_measurement_mm / rig.axle.support_to_wheel_centre_mm
