"""Simulated recordings of an axle's step, as a motion is fitted to them."""

from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.steps import find_step
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.simulator import simulate_record

RIG = load_rig("single")


def recorded(plan, seed):
    """Return a simulated record's truth, and the record as the fit takes it."""
    truth = draw_truth(plan._replace(duration_s=2.5, step_between_s=(0.9, 1.1)), RIG, seed)
    signals = find_channels(simulate_record(truth, RIG).raw, RIG)
    step = find_step(signals)
    _, acceleration, laser, load = signals
    ramp = step.ramp.start_s, step.ramp.end_s
    return truth, Recorded(signals.dt_s, acceleration, laser, load, step.pre_step, ramp)
