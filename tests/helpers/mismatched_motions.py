"""Records of the study of motions with one mismatch, simulated by an integrator that is not the fit's."""

from collections.abc import Callable
from functools import cache

from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.process import prepare
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.truth import Truth
from bayes_tyre.studies.motion_machine import Machine, recorded_on
from bayes_tyre.studies.motion_mismatch import MISMATCHES
from bayes_tyre.studies.motion_study import STATIONARY, study_records


def simulated(mismatch: str, number: int, kind: str = STATIONARY) -> tuple[Truth, Rig, Recorded]:
    """Return truth, rig and recording of a standing or rolling record with a mismatch."""
    return simulated_on(MISMATCHES[mismatch].machine, number, MISMATCHES[mismatch].change, kind)


@cache  # some seconds for a rolling record
def simulated_on(
    machine: Machine,
    number: int,
    change: Callable[[Truth, Rig], Truth] = lambda truth, _: truth,
    kind: str = STATIONARY,
) -> tuple[Truth, Rig, Recorded]:
    """Return truth, rig and recording of a standing or rolling record on a machine."""
    record = [record for record in study_records(0, 0, 0, number + 1) if record.kind == kind][number]
    rig = load_rig(record.plan.case.configuration)
    truth = change(draw_truth(record.plan, rig, 20 + number), rig)
    raw = recorded_on(machine, truth, rig)
    factors = RecordFactors(record.plan.record, record.plan.case, record.plan.repeat)
    return truth, rig, Recorded(*prepare(raw, rig, factors).for_motion())
