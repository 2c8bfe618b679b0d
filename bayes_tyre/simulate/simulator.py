"""One record from its truth: the axle driven through the load's step, and what the sensors make of it."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.record import RawSignals
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import Body, Drive, Motion, Start, move, node_times, rest_displacement, substeps_for
from bayes_tyre.simulate.drive import WARM_UP_S, cylinder_load, runout
from bayes_tyre.simulate.sensors import channels
from bayes_tyre.simulate.truth import Truth


class Simulated(NamedTuple):
    """A simulated record.

    Attributes
    ----------
    raw:
        What its file holds.
    time_s:
        Sampling times, s, shape (samples,).
    motion:
        Of the wheel centre, without noise, at the sampling times.
    row:
        Its row of `truth.csv`: the truth, the state at the first sample (wheel centre; friction on flat ground), and
        the flat-ground point from which the load's step starts, d_i and F_i.
    """

    raw: RawSignals
    time_s: Float[np.ndarray, " samples"]
    motion: Motion
    row: dict[str, object]


def simulate_record(truth: Truth, rig: Rig, law: StatefulLaw | None = None) -> Simulated:
    """Return the record that a truth gives on a rig.

    Parameters
    ----------
    truth:
        What is true of it (`draw_truth`, or that with fields replaced).
    rig:
        The rig it is made on.
    law:
        Another law than `Fancher` with the truth's parameters, for studies of a fit that takes the wrong one. The
        truth's k, C and rest friction then still say where it starts.

    Raises
    ------
    BadInput
        If the law makes energy (x < k beta), or the tyre lifts off its rollers.
    """
    plan = truth.plan
    law = law or Fancher(k=truth.k_kN_per_mm, C=truth.C_kN, x=truth.x_kN, beta=truth.beta_mm)
    try:
        law.check()
    except ValueError as error:
        raise BadInput(f"{plan.label}: {error}; choose other parameters") from None
    before = round(WARM_UP_S * plan.rate_Hz) if plan.case.speed_km_h > 0 else 0
    time_s = np.arange(-before, round(plan.duration_s * plan.rate_Hz)) / plan.rate_Hz
    substeps = substeps_for(1 / plan.rate_Hz)
    nodes = node_times(time_s, substeps)
    drive = Drive(nodes, geometry.tyre_load(rig, cylinder_load(truth, nodes)), runout(truth, nodes))
    offset = truth.C_kN + truth.rest_friction_kN
    body = Body(law, truth.m_kg, truth.c_kN_s_per_mm)
    moved = _from_rest(rig, body, drive, truth.k_kN_per_mm, offset).at_samples(substeps)
    time_s, motion = time_s[before:], jax.tree.map(lambda values: np.asarray(values)[before:], moved)
    if motion.tyre_force_kN.min() <= 0:
        raise BadInput(f"{plan.label}: the tyre lifts off its rollers; choose a smaller step or a longer rise")
    raw = channels(
        truth, rig, time_s, motion.displacement_mm, motion.acceleration_m_per_s2, cylinder_load(truth, time_s)
    )
    row = {**truth.row(), **_states(truth, rig, time_s, motion), "origin": "simulated"}
    return Simulated(raw, time_s, motion, row)


@functools.partial(jax.jit, static_argnums=0)
def _from_rest(rig: Rig, body: Body, drive: Drive, k: ScalarLike, offset_kN: ScalarLike) -> Motion:
    """Return the motion from rest under the first applied force, where the tyre's force is k d + offset."""
    first_kN, first_mm = jnp.asarray(drive.applied_kN)[0], jnp.asarray(drive.runout_mm)[0]
    at_rest = rest_displacement(rig, first_kN, k=k, offset_kN=offset_kN)
    return move(rig, body, drive, Start(at_rest - first_mm))


def _states(truth: Truth, rig: Rig, time_s: Float[np.ndarray, " samples"], motion: Motion) -> dict[str, object]:
    # The first sample and the last before the load's step.
    at = np.array([0, max(0, np.searchsorted(time_s, truth.step_start_s, side="right") - 1)])
    compression = motion.displacement_mm[at] + runout(truth, time_s[at])
    d = np.asarray(geometry.flat_ground_displacement(rig, compression))
    F = np.asarray(geometry.flat_ground_force(rig, motion.tyre_force_kN[at], compression))
    return {
        "start_displacement_mm": float(motion.displacement_mm[0]),
        "start_velocity_mm_per_s": float(motion.velocity_mm_per_s[0]),
        "start_tyre_force_kN": float(motion.tyre_force_kN[0]),
        "start_friction_kN": float(F[0] - truth.k_kN_per_mm * d[0] - truth.C_kN),
        "d_i_mm": float(d[1]),
        "F_i_kN": float(F[1]),
    }
