"""Stiffness of a cycle on flat ground as other tests measure it: slow, at 1 Hz, and in free vibration.

A step's k is the slope of the middle line between the branches. A cycle's stiffness is its change of force over its
stroke: with friction it exceeds k by the height of the loop at its ends, the more the smaller the cycle is beside beta.
So one law predicts a stiffness for each test, and numbers of different tests are compared with these instead of with k.

Source: Taylor, Bashford and Schrock (2000), Methods for measuring vertical tire stiffness, Transactions of the ASAE 43,
who found an agricultural drive tyre that did not roll stiffer in free vibration than by their other methods.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.cycle.energy import free_omega, steady_cycle, stroke_on_flat
from bayes_tyre.inference.motion.laws import MotionLaw
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.record import RING_DOWN_MM
from bayes_tyre.rig.axle import Rig

#: 1 Hz, 1/s: the slowest cycle of usual test machines.
_ONE_HZ = 2.0 * np.pi


class Stiffnesses(NamedTuple):
    """Change of force over stroke, kN/mm on flat ground.

    Attributes
    ----------
    static_kN_per_mm, one_Hz_kN_per_mm:
        Of a cycle of the amplitude asked for, infinitely slow, and at 1 Hz. A law of displacement alone has no
        difference between them.
    ring_down_kN_per_mm:
        Of a cycle of `RING_DOWN_MM`, as fast as the mass swings freely on k.
    """

    static_kN_per_mm: Float[Array, "*draws"]
    one_Hz_kN_per_mm: Float[Array, "*draws"]
    ring_down_kN_per_mm: Float[Array, "*draws"]


def stiffnesses(
    rig: Rig, law: Any, m_kg: ScalarLike, displacement_mm: ScalarLike, amplitude_mm: ScalarLike
) -> Stiffnesses:
    """Return the stiffness of cycles about a displacement; arguments as in `bayes_tyre.inference.motion.cycle.energy`.

    Dampers add to a cycle's loss and, in quadrature, not to its stiffness.
    """
    d = jnp.asarray(displacement_mm, float)
    asked, small = (stroke_on_flat(rig, d, jnp.asarray(a, float)) for a in (amplitude_mm, RING_DOWN_MM))
    cycles = ((asked, 0.0), (asked, _ONE_HZ), (small, free_omega(rig, law, m_kg, d)))
    return Stiffnesses(*(_of_cycle(law, stroke, jnp.asarray(omega)) for stroke, omega in cycles))


def _of_cycle(law: Any, stroke_mm: Array, omega: Array) -> Array:
    """Return the stiffness of a steady cycle, kN/mm."""
    if isinstance(law, RigidRing):
        return jnp.real(law.dynamic_stiffness(omega))
    if isinstance(law, KelvinVoigt):
        return jnp.asarray(law.k)
    if isinstance(law, Fancher):
        # Off the middle line the force settles exponentially to +-(x - k beta): a stroke from -h ends at h.
        settled = jnp.subtract(law.x, jnp.multiply(law.k, law.beta))
        return jnp.add(law.k, settled * jnp.tanh(stroke_mm / law.beta) / stroke_mm)
    # Off its middle line a law is the same about any displacement.
    return law.k + jnp.ptp(steady_cycle(law, jnp.zeros(()), stroke_mm)[1]) / (2.0 * stroke_mm)


def stiffnesses_from_reported(
    rig: Rig, law: MotionLaw, values: Float[Array, " p"], displacement_mm: ScalarLike, amplitude_mm: ScalarLike
) -> Stiffnesses:
    """Return the stiffness of cycles from a law's `reported_parameters`; other arguments as in `stiffnesses`."""
    return stiffnesses(rig, law.from_reported(values), values[-2], displacement_mm, amplitude_mm)
