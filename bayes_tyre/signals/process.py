"""From a file's raw signals and its factors to a record, by a named method."""

from collections.abc import Callable

from bayes_tyre.errors import BadInput
from bayes_tyre.record import DISPLACEMENT_SCALE_SD, FORCE_SCALE_SD, RawSignals
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.inertia import inertia
from bayes_tyre.signals.processed import Processed, Recording
from bayes_tyre.signals.ramp import find_ramp
from bayes_tyre.signals.runout import nominal_bodies, remove_runout
from bayes_tyre.signals.steps import find_step, pre_step_samples
from bayes_tyre.signals.thesis import thesis

METHODS: dict[str, Callable[[Recording, Rig], Processed]] = {"thesis": thesis, "inertia": inertia}
# Relative tolerance of a step's change: set points are not met exactly, and other cases differ by more.
_STEP_TOLERANCE = 0.4


def prepare(raw: RawSignals, rig: Rig, factors: RecordFactors) -> Recording:
    """Return a recording ready for a method: channels in units, runout of a rolling tyre removed, step found.

    Raises
    ------
    BadInput
        If the recording cannot be used; the message has the reason and the value.
    """
    as_read = find_channels(raw, rig)
    ramp = find_ramp(as_read.load_kN, as_read.dt_s)
    signals, rms, turning = as_read, 0.0, ()
    if factors.case.speed_km_h > 0:
        bodies = nominal_bodies(rig, factors.case.speed_km_h)
        signals, runout = remove_runout(as_read, pre_step_samples(ramp, as_read), bodies)
        ramp, rms = find_ramp(signals.load_kN, signals.dt_s), runout.acceleration_rms_m_per_s2
        turning = runout.bodies
    step = find_step(signals, ramp)
    nominal = factors.case.step_kN
    if abs(step.change_kN - nominal) > _STEP_TOLERANCE * abs(nominal):
        raise BadInput(
            f"load changes by {step.change_kN:.3g} kN where the factors say {nominal:+g} kN; mend the file's name or "
            "--cases, or the sign of the load in [signs] of the rig file"
        )
    return Recording(factors, as_read, signals, step, rms, turning)


def process(raw: RawSignals, rig: Rig, factors: RecordFactors, method: str) -> Processed:
    """Return the record that a method of `METHODS` makes of raw signals.

    Raises
    ------
    BadInput
        If they cannot be used; the message has the reason and the value.
    """
    processed = METHODS[method](prepare(raw, rig, factors), rig)
    return processed._replace(extras=processed.extras | scale_sds(rig))


def scale_sds(rig: Rig) -> dict[str, float]:
    """Return how well the factors on displacement and force are known, by column; nothing of one with no word on it."""
    sds = {
        DISPLACEMENT_SCALE_SD: geometry.displacement_relative_sd(rig),
        FORCE_SCALE_SD: geometry.force_relative_sd(rig),
    }
    return {column: sd for column, sd in sds.items() if sd > 0}
