"""A machine and a tyre that are not those of the motion fit: the yardstick of `motion_mismatch`.

Written in plain Python and NumPy: Runge and Kutta's fourth-order steps of ``m d'' = F - F_tyre - c d'``, with friction
as its own differential equation. It shares neither integrator nor law with the fit; at the defaults of `Machine` the
two agree (tested).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq
from scipy.signal import lfilter

from bayes_tyre.record import RawSignals
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2
from bayes_tyre.simulate.drive import WARM_UP_S, cylinder_load, runout
from bayes_tyre.simulate.sensors import channels
from bayes_tyre.simulate.truth import Truth

Values = Float[np.ndarray, " times"]
State = tuple[float, ...]

#: Longest step, s. A standing axle rests until so long before its load's step, s.
STEP_S, AT_REST_S = 5e-5, 0.01
#: Iterations for the middle of the step of a tyre whose stiffness grows; each leaves a few per cent of the error.
_MIDDLE_STEPS = 6


class Machine(NamedTuple):
    """What rig and tyre have that the fit's model has not; the defaults are the model.

    Attributes
    ----------
    overshoot, overshoot_Hz, overshoot_s:
        A load that rings after its step: first peak (share of the step), frequency and decay time.
    laser_lag_s, laser_average_s:
        Time constant of the laser's first-order lag, and the time over which it averages.
    laser_factor, arm_factor:
        What the laser reads over what moves before it; the same of laser and accelerometer together, as an arm to them
        that is longer than the rig file says makes it.
    load_cell_kg, load_cell_lag_s:
        Mass between load cell and axle, whose inertia the cell reads, and the time constant of its amplifier's filter.
    beam_Hz, beam_share, beam_damping:
        A second mode under both sensors, driven by the axle's acceleration: frequency, share of the axle's movement
        that its inertia follows, share of critical damping.
    relaxing, relaxing_s:
        A spring in series with a damper beside the tyre: share of k, and relaxation time.
    falling, falling_mm_per_s:
        Share by which friction falls with speed, and the speed that takes 63 % of it.
    growth_per_mm:
        Relative growth of the stiffness with deflection about the middle of the step.
    yields:
        Factors on beta of elements of friction with equal shares of x - k beta; their mean is 1.
    """

    overshoot: float = 0.0
    overshoot_Hz: float = 18.0
    overshoot_s: float = 0.08
    laser_lag_s: float = 0.0
    laser_average_s: float = 0.0
    laser_factor: float = 1.0
    arm_factor: float = 1.0
    load_cell_kg: float = 0.0
    load_cell_lag_s: float = 0.0
    beam_Hz: float = 60.0
    beam_share: float = 0.0
    beam_damping: float = 0.02
    relaxing: float = 0.0
    relaxing_s: float = 0.008
    falling: float = 0.0
    falling_mm_per_s: float = 30.0
    growth_per_mm: float = 0.0
    yields: tuple[float, ...] = (1.0,)


class Path(NamedTuple):
    """The motion at the sampling times: displacement (mm), acceleration (m/s^2), both as the beam shows them."""

    time_s: Values
    displacement_mm: Values
    acceleration_m_per_s2: Values


def recorded_on(machine: Machine, truth: Truth, rig: Rig) -> RawSignals:
    """Return the raw signals of a truth on a machine, in the form of `bayes_tyre.simulate`."""
    path = travelled(machine, truth, rig)
    load = load_of(machine, truth, path.time_s)
    at_load = rig.axle.support_to_load_mm / rig.axle.support_to_wheel_centre_mm * path.acceleration_m_per_s2
    at_cell, rate_Hz = load + machine.load_cell_kg * at_load * 1e-3, truth.plan.rate_Hz
    read = _late(at_cell, rate_Hz, machine.load_cell_lag_s)
    moved, acceleration = machine.arm_factor * path.displacement_mm, machine.arm_factor * path.acceleration_m_per_s2
    seen = machine.laser_factor * _late(moved, rate_Hz, machine.laser_lag_s, machine.laser_average_s)
    return channels(truth, rig, path.time_s, seen, acceleration, read)


def load_of(machine: Machine, truth: Truth, time_s: Values) -> Values:
    """Return the cylinder's force, kN, at times, s."""
    load = cylinder_load(truth, time_s)
    if machine.overshoot == 0:
        return load
    after = np.maximum(time_s - truth.step_start_s - truth.rise_time_s, 0.0)
    angle = 2 * np.pi * machine.overshoot_Hz * after
    peak = math.exp(-0.25 / (machine.overshoot_Hz * machine.overshoot_s))
    ringing = machine.overshoot / peak * np.exp(-after / machine.overshoot_s) * np.sin(angle)
    return load + (truth.load_after_kN - truth.load_before_kN) * ringing


def travelled(machine: Machine, truth: Truth, rig: Rig) -> Path:
    """Return the motion of a truth on a machine, at the sampling times."""
    plan = truth.plan
    rolls = plan.case.speed_km_h > 0
    samples, parts = round(plan.duration_s * plan.rate_Hz), max(1, math.ceil(1 / (plan.rate_Hz * STEP_S) - 1e-9))
    first = -round(WARM_UP_S * plan.rate_Hz) if rolls else math.floor((truth.step_start_s - AT_REST_S) * plan.rate_Hz)
    dt = 1 / (plan.rate_Hz * parts)
    steps = (samples - 1 - first) * parts
    nodes = first / plan.rate_Hz + np.arange(2 * steps + 1) * (dt / 2)
    force = np.asarray(geometry.tyre_load(rig, load_of(machine, truth, nodes))).tolist()
    ground = runout(truth, nodes)
    rise = np.gradient(ground, dt / 2) if rolls else np.zeros_like(ground)
    start, rate = _equations(machine, truth, rig, force[0], float(ground[0]))
    states = _integrate(rate, start, (force, ground.tolist(), rise.tolist()), dt, parts)
    at = slice(0, None, 2 * parts)
    acceleration = [
        rate(state, *drive)[1] for state, *drive in zip(states, force[at], ground[at], rise[at], strict=True)
    ]
    table = np.array(states)
    beam, beam_acceleration = table[:, 3], np.gradient(table[:, 4], 1 / plan.rate_Hz)
    before = max(0, first)
    displacement = np.concatenate([np.full(before, table[0, 0]), table[:, 0] + beam])[-samples:]
    shown = np.concatenate([np.zeros(before), np.array(acceleration) + beam_acceleration])[-samples:]
    return Path(np.arange(samples) / plan.rate_Hz, displacement, shown * 1e-3)


def _integrate(
    rate: Callable[..., State], state: State, drive: tuple[list[float], ...], dt: float, parts: int
) -> list[State]:
    """Return the states at every `parts`-th step of Runge and Kutta's; the drive is given at ends and middles."""
    states = [state]

    def moved(by: State, share: float) -> State:
        return tuple(value + share * slope for value, slope in zip(state, by, strict=True))

    for step in range((len(drive[0]) - 1) // 2):
        start, middle, end = ([values[2 * step + i] for values in drive] for i in range(3))
        one = rate(state, *start)
        two = rate(moved(one, dt / 2), *middle)
        three = rate(moved(two, dt / 2), *middle)
        four = rate(moved(three, dt), *end)
        state = tuple(
            value + dt / 6 * (a + 2 * b + 2 * c + d)
            for value, a, b, c, d in zip(state, one, two, three, four, strict=True)
        )
        if (step + 1) % parts == 0:
            states.append(state)
    return states


def _equations(
    machine: Machine, truth: Truth, rig: Rig, force_kN: float, ground_mm: float
) -> tuple[State, Callable[..., State]]:
    """Return the state at rest under a force, and the derivatives of a state: d, v, relaxing force, beam, frictions."""
    k, mass, factor = truth.k_kN_per_mm, truth.m_kg * KN_PER_KG_MM_PER_S2, geometry.curvature_factor(rig)
    settled = (truth.x_kN - k * truth.beta_mm) / len(machine.yields)
    height = geometry.centre_height_mm(rig) if rig.rollers else 1.0
    spacing = rig.rollers.half_spacing_mm if rig.rollers else 0.0
    betas, frictions = [truth.beta_mm * share for share in machine.yields], len(machine.yields)
    omega = 2 * math.pi * machine.beam_Hz

    def spring(flat: float, middle: float) -> float:
        return k * flat + truth.C_kN + 0.5 * k * machine.growth_per_mm * ((flat - middle) ** 2)

    def sine(compression: float) -> float:
        above = height - compression
        return above / math.hypot(above, spacing)

    def at_rest(force: float, middle: float) -> float:
        def surplus(c: float) -> float:
            return (spring(c * sine(c), middle) + truth.rest_friction_kN) * factor * sine(c) - force

        return brentq(surplus, -20.0, 100.0, xtol=1e-12)  # pyright: ignore[reportReturnType]

    middle, loads = 0.0, [float(geometry.tyre_load(rig, load)) for load in (truth.load_before_kN, truth.load_after_kN)]
    for _ in range(_MIDDLE_STEPS if machine.growth_per_mm else 0):
        # The ends of the step depend on where the stiffness is k, which is the middle between them.
        middle = sum(c * sine(c) for c in (at_rest(load, middle) for load in loads)) / 2

    def rate(state: State, force: float, ground: float, rise: float) -> State:
        d, v, relaxing, beam, beam_v, *friction = state
        compression, s = d + ground, sine(d + ground)
        # d/dc of the sine is -(1 - s^2) s / above, and above = height - c.
        flat_v = (v + rise) * (s - compression * (1 - s * s) * s / (height - compression))
        speed = abs(flat_v)
        tyre = (spring(compression * s, middle) + relaxing + sum(friction)) * factor * s
        a = (force - tyre - truth.c_kN_s_per_mm * v) / mass
        limit = settled * (1 - machine.falling * (1 - math.exp(-speed / machine.falling_mm_per_s)))
        slipping = ((limit * flat_v - speed * f) / beta for f, beta in zip(friction, betas, strict=True))
        loosening = machine.relaxing * k * flat_v - relaxing / machine.relaxing_s
        shaken = -machine.beam_share * a - 2 * machine.beam_damping * omega * beam_v - omega**2 * beam
        return (v, a, loosening, beam_v, shaken, *slipping)

    d = at_rest(force_kN, middle) - ground_mm
    return (d, 0.0, 0.0, 0.0, 0.0, *[truth.rest_friction_kN / frictions] * frictions), rate


def _late(values: Values, rate_Hz: float, lag_s: float, average_s: float = 0.0) -> Values:
    """Return values as a sensor shows them that averages and lags."""
    first = values[0]
    shown = values - first
    length = max(1, round(average_s * rate_Hz))
    if length > 1:
        shown = lfilter(np.full(length, 1 / length), 1.0, shown)
    if lag_s > 0:
        decay = math.exp(-1 / (rate_Hz * lag_s))
        shown = lfilter([1 - decay], [1.0, -decay], shown)
    return first + np.asarray(shown)
