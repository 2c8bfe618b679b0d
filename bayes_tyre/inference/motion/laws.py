"""The force laws that a motion can be fitted with: what is unknown of each, what was known of it, how it is made.

A further law is a file of `bayes_tyre.laws` and an entry here: its parameters, positive all, and their priors. What a
case of records has of them is in `bayes_tyre.inference.model.priors`, by the same names.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.maxwell_slip import MaxwellSlip
from bayes_tyre.laws.rigid_ring import RigidRing


class Before(NamedTuple):
    """What is known of a number before its record: normal with this location and scale, and why.

    NaN stands for what the rig file or the record's own rest before and after the step says
    (`bayes_tyre.inference.motion.record.parameters.priors_of`).
    """

    location: float
    scale: float
    reason: str


#: Of the logarithms of parameters, by name. Laws that have one by the same name mean the same by it, so that no law is
#: favoured by what was known before. `settled` is half the distance between the branches on which the force settles;
#: of Fancher's law x - k beta, which loses energy only where x > k beta: there is no other place to go.
OF_TYRES: dict[str, Before] = {
    "k": Before(np.log(1.0), 1.0, "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres, as `k_group` of the fit"),
    "settled": Before(np.log(0.2), 1.0, "0.03 to 1.4 kN: 0.1 to 10 % of a truck tyre's load as friction"),
    "beta": Before(np.log(0.1), 1.5, "0.005 to 1.9 mm: below the travel between two samples to half a step's travel"),
    "n": Before(0.0, 0.4, "0.46 to 2.2 about 1, where Bouc-Wen's law is Fancher's: slower or more sudden settling"),
    "belt_frequency": Before(np.log(60.0), 0.4, "27 to 131 Hz: the belt's first swing, of heavy tyres to small ones"),
    "belt_damping": Before(np.log(0.05), 0.7, "1.3 to 20 % of critical: rubber, as the axle's own damper"),
    "sidewall_ratio": Before(np.log(4.0), 0.7, "1 to 16: more of the deflection is beneath the belt than beside it"),
}
#: What the estimate of any motion has behind the parameters of its tyre.
OF_AXLE = ("m", "c")


class MotionLaw(eqx.Module):
    """How a law is fitted. A pytree without leaves: it may go where arrays go, and is compiled for.

    Attributes
    ----------
    name:
        As `motion --law` has it.
    unknowns:
        The tyre's parameters whose logarithms are unknown, in their order; names of `OF_TYRES`, k the first.
    told:
        What estimates tell in their place, in the same order: fields of the law.
    law:
        Its class; `told` and C are its fields.
    """

    name: str = eqx.field(static=True)
    unknowns: tuple[str, ...] = eqx.field(static=True)
    told: tuple[str, ...] = eqx.field(static=True)
    law: Callable[..., StatefulLaw] = eqx.field(static=True)

    @property
    def parameters(self) -> tuple[str, ...]:
        """What records and cases have in the hierarchy: the unknowns, mass and damping."""
        return (*self.unknowns, *OF_AXLE)

    @property
    def told_parameters(self) -> tuple[str, ...]:
        """What a record's estimate tells, in the same order."""
        return (*self.told, *OF_AXLE)

    @property
    def has_friction(self) -> bool:
        """Whether the law itself loses energy; one that does not leaves it all to the damper."""
        return "settled" in self.unknowns

    def of_logs(self, logs: Float[Array, " parameters"], C: ScalarLike = 0.0) -> StatefulLaw:
        """Return the law from the logarithms of its unknowns, shape (parameters,); the axle's are passed over."""
        of = dict(zip(self.unknowns, jnp.exp(logs), strict=False))
        if "x" in self.told:
            of["x"] = of.pop("settled") + of["k"] * of["beta"]
        return self.law(**of, C=C)

    def of_told(self, told: Float[Array, " parameters"], C: ScalarLike = 0.0) -> StatefulLaw:
        """Return the law from what estimates tell, in units, shape (parameters,); the axle's are passed over."""
        return self.law(**dict(zip(self.told, told, strict=False)), C=C)


# Between two samples a tyre moves by less than beta: with one step of Bouc-Wen's integration instead of four readings
# differ by 0.003 of their noise, and a fit takes a seventh of the time.
_bouc_wen = partial(BoucWen, substeps=1)
_FRICTION = ("k", "settled", "beta")
_RING = ("k", "belt_frequency", "belt_damping", "sidewall_ratio")
FANCHER = MotionLaw("fancher", _FRICTION, ("k", "x", "beta"), Fancher)
KELVIN_VOIGT = MotionLaw("kelvin_voigt", ("k",), ("k",), KelvinVoigt)
#: By name, the thesis's first.
MOTION_LAWS: dict[str, MotionLaw] = {
    law.name: law
    for law in (
        FANCHER,
        KELVIN_VOIGT,
        MotionLaw("bouc_wen", (*_FRICTION, "n"), (*_FRICTION, "n"), _bouc_wen),
        MotionLaw("maxwell_slip", _FRICTION, _FRICTION, MaxwellSlip),
        MotionLaw("rigid_ring", _RING, _RING, RigidRing),
    )
}


def motion_law(name: str) -> MotionLaw:
    """Return a law by its name.

    Raises
    ------
    BadInput
        If there is none by this name.
    """
    if name not in MOTION_LAWS:
        raise BadInput(f"law {name!r} is unknown; use {', '.join(MOTION_LAWS)}")
    return MOTION_LAWS[name]
