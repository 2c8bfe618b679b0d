"""Mismatches between the motion model and the truth: a row of a table each."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from bayes_tyre.rig.axle import Rig
from bayes_tyre.simulate.truth import Truth
from bayes_tyre.studies.motion_machine import Machine

#: Frequency of the turns of wheel and rollers over that from the speed's label; mass over the rig file's; slope of the
#: road's spectrum, half that of the fit.
TURNS, MASS, ROAD_SLOPE = 1.02, 1.05, 0.5


class Mismatch(NamedTuple):
    """A machine that is not the model's, and how the truth differs from the drawn one.

    Attributes
    ----------
    machine:
        What the simulator has beyond the model.
    change:
        From a truth and its rig to the truth that is simulated.
    rolling_only:
        Whether a standing record cannot have it.
    """

    machine: Machine = Machine()
    change: Callable[[Truth, Rig], Truth] = lambda truth, _: truth
    rolling_only: bool = False


def _shape(name: str) -> Callable[[Truth, Rig], Truth]:
    return lambda truth, _: replace(truth, load_shape=name)


def _mass(truth: Truth, rig: Rig) -> Truth:
    return replace(truth, m_kg=MASS * rig.axle.effective_mass_kg)


def _turns(truth: Truth, _: Rig) -> Truth:
    runout = truth.runout
    faster = {name: getattr(runout, name) * TURNS for name in ("wheel_turn_Hz", "roller_turn_Hz")}
    return replace(truth, runout=runout._replace(**faster))


def _road(truth: Truth, _: Rig) -> Truth:
    return replace(truth, runout=truth.runout._replace(road_slope=ROAD_SLOPE))


#: Mismatches by name.
MISMATCHES: dict[str, Mismatch] = {
    "none": Mismatch(),
    "first-order lag": Mismatch(change=_shape("first-order lag")),
    "load in two stages": Mismatch(change=_shape("two stages")),
    "overshoot 6 % at 18 Hz": Mismatch(Machine(overshoot=0.06)),
    "laser lag 1.5 ms": Mismatch(Machine(laser_lag_s=1.5e-3, laser_average_s=2e-3)),
    "12 kg on the load cell": Mismatch(Machine(load_cell_kg=12.0)),
    "beam mode at 60 Hz": Mismatch(Machine(beam_share=0.3)),
    "relaxing branch": Mismatch(Machine(relaxing=0.08)),
    "friction falls 15 %": Mismatch(Machine(falling=0.15)),
    "stiffness grows 3 %/mm": Mismatch(Machine(growth_per_mm=0.03)),
    "two yield scales": Mismatch(Machine(yields=(0.4, 1.6))),
    "mass 5 % off": Mismatch(change=_mass),
    "speed label 2 % off": Mismatch(change=_turns, rolling_only=True),
    "road's slope 0.5": Mismatch(change=_road, rolling_only=True),
    "three together": Mismatch(Machine(overshoot=0.06, laser_lag_s=1.5e-3, laser_average_s=2e-3, relaxing=0.08)),
    "load cell filter 3 ms": Mismatch(Machine(load_cell_lag_s=3e-3)),
    "laser reads 1 % more": Mismatch(Machine(laser_factor=1.01)),
    "arm 1 % longer": Mismatch(Machine(arm_factor=1.01)),
}
