"""A load that rings: its valve and oil follow what they are asked for as a damped oscillator does.

``r = -(g_1 v'' + g_2 omega v')``, added to the share ``s`` of the step that the load has completed (`load_step`), where
``v'' + 2 zeta omega v' + omega^2 v = s``: any response of second order that ends where it is asked to. With g_1 = 1 and
g_2 = 2 zeta the load follows as a mass on a damped spring does; a small g_1 and g_2 of either sign is one that rings a
little, at any phase.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.laws import NormalPrior
from bayes_tyre.inference.motion.record.model.oscillator import oscillation
from bayes_tyre.laws.base import ScalarLike

#: Priors of the parameters, which follow those of a record and of a rolling tyre's ground.
RINGING_PRIORS: dict[str, NormalPrior] = {
    "log_ringing_Hz": NormalPrior(np.log(18.0), 0.6, "5 to 60 Hz: servo valves with some litres of oil"),
    "log_ringing_damping_ratio": NormalPrior(np.log(0.1), 0.5, "4 to 27 % of critical: leakage and friction of seals"),
    "ringing_of_acceleration": NormalPrior(0.0, 0.15, "up to a third of the step: one that rings more is tuned anew"),
    "ringing_of_speed": NormalPrior(0.0, 0.15, "as that of acceleration, at another phase"),
}


class Ringing(NamedTuple):
    """How a load rings: frequency (Hz), share of critical damping, and g_1 and g_2."""

    frequency_Hz: Array
    damping_ratio: Array
    of_acceleration: Array
    of_speed: Array


def ringing_priors() -> Float[np.ndarray, "2 4"]:
    """Return means and standard deviations of the priors of a load's ringing."""
    return np.array([[prior.mean, prior.sd] for prior in RINGING_PRIORS.values()]).T


def ringing_in_units(value: Float[Array, " 4"]) -> Ringing:
    """Return a ringing in physical units from the values of its parameters on the scale of their priors."""
    return Ringing(jnp.exp(value[0]), jnp.exp(value[1]), value[2], value[3])


def ringing_share(ringing: Ringing, share: Float[Array, " nodes"], dt_s: ScalarLike) -> Float[Array, " nodes"]:
    """Return what a load that rings adds to the share of its step that it has completed, 0 at first and in the end.

    Parameters
    ----------
    ringing:
        Of the load.
    share:
        Of the step, at nodes, 0 at the first.
    dt_s:
        Spacing of the nodes, s.
    """
    _, speed, acceleration = oscillation(ringing.frequency_Hz, ringing.damping_ratio, share, dt_s)
    omega = 2 * jnp.pi * ringing.frequency_Hz
    return -(ringing.of_acceleration * acceleration + ringing.of_speed * omega * speed)
