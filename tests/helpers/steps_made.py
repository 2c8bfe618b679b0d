"""Recordings of steps: simulated by the package, or made of plain shapes with a step wherever it is wanted."""

import functools

import numpy as np

from bayes_tyre.record import Channel, RawSignals
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.channels import Signals
from bayes_tyre.signals.factors import RecordFactors, record_name
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import Planned, thesis_plan
from bayes_tyre.simulate.simulator import Simulated, simulate_record

RIGS = {name: load_rig(name) for name in ("single", "dual")}
RIG = RIGS["single"]


def planned(file: str, rate_Hz: float = 5000.0, duration_s: float = 3.0, start_s: float = 1.2) -> Planned:
    record = next(record for record in thesis_plan(rate_Hz) if record.file == file)
    return record._replace(duration_s=duration_s, step_between_s=(start_s, start_s + 0.05))


@functools.cache
def simulated(
    file: str, rate_Hz: float = 5000.0, duration_s: float = 3.0, start_s: float = 1.2, seed: int = 0
) -> tuple[Simulated, RecordFactors]:
    """Return a simulated record of the test plan, cut short, and its words."""
    plan = planned(file, rate_Hz, duration_s, start_s)
    rig = RIGS[plan.case.configuration]
    factor_table = RecordFactors(record_name(plan.file), plan.case, plan.repeat)
    return simulate_record(draw_truth(plan, rig, seed), rig), factor_table


def plain(
    change_kN: float = -10.0,
    start_s: float = 1.0,
    duration_s: float = 2.5,
    rate_Hz: float = 2000.0,
    load_sd: float = 0.4,
    seed: int = 0,
) -> Signals:
    """Return a ramp of the load over 40 ms and one full sine of acceleration under it: 30 kN before, noise as given."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(duration_s * rate_Hz)) / rate_Hz
    s = np.clip((time_s - start_s) / 0.04, 0.0, 1.0)
    acceleration = -np.sign(change_kN) * 4.0 * np.sin(2 * np.pi * s) * (abs(change_kN) > 0)
    return Signals(
        time_s,
        acceleration + 0.02 * rng.standard_normal(len(s)) + 0.013,
        660.0 + 0.3 * change_kN * s + 0.015 * rng.standard_normal(len(s)),
        30.0 + change_kN * s + load_sd * rng.standard_normal(len(s)),
    )


def raw_of(signals: Signals, names: tuple[str, str, str] = ("Acc m/s^2", "Disp mm", "Load kN")) -> RawSignals:
    channels = (Channel(name, "", signals.time_s, values) for name, values in zip(names, signals[1:], strict=True))
    return RawSignals((tuple(channels),))
