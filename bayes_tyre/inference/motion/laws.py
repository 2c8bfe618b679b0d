"""The force laws that a motion can be fitted with: their parameters, the priors, and how to build the law.

To add a law, write a file of `bayes_tyre.laws` and an entry here: its parameters, all positive, and their priors.
Priors of the cases are in `bayes_tyre.inference.model.default_priors`, by the same names.

A law that extends Fancher's has extensions beside the parameters: numbers of one record, which are integrated out of
its estimate. So these laws have the hierarchy's parameters in common, and can be averaged.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.extended_fancher import ExtendedFancher
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.maxwell_slip import MaxwellSlip
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.record import AXLE_PARAMETERS


class NormalPrior(NamedTuple):
    """A normal prior of one parameter of a record, and the reason for it.

    NaN is replaced by a value from the rig file or from the record's own rest before and after the step
    (`bayes_tyre.inference.motion.record.model.parameters.prior_moments`).
    """

    mean: float
    sd: float
    reason: str


#: Priors of the logarithms of tyre parameters, by name. A name means the same in every law, so that no law is favoured
#: by its prior. `settled` is half the distance between the branches on which the force settles. For Fancher's law it is
#: x - k beta, positive because the law loses energy only where x > k beta.
TYRE_PRIORS: dict[str, NormalPrior] = {
    "k": NormalPrior(np.log(1.0), 1.0, "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres, as `k_group` of the fit"),
    "settled": NormalPrior(np.log(0.2), 1.0, "0.03 to 1.4 kN: 0.1 to 10 % of a truck tyre's load as friction"),
    "beta": NormalPrior(np.log(0.1), 1.5, "0.005 to 1.9 mm: less than between two samples to half a step's travel"),
    "n": NormalPrior(0.0, 0.4, "0.46 to 2.2 about 1, where Bouc-Wen's law is Fancher's: slow to sudden settling"),
    "belt_frequency": NormalPrior(np.log(60.0), 0.4, "27 to 131 Hz: the belt's first mode, heavy to small tyres"),
    "belt_damping": NormalPrior(np.log(0.05), 0.7, "1.3 to 20 % of critical: rubber, as the axle's own damper"),
    "sidewall_ratio": NormalPrior(np.log(4.0), 0.7, "1 to 16: most of the deflection is beneath the belt"),
}


class Extension(NamedTuple):
    """A number of one record by which its tyre departs from Fancher's law: a field of `ExtendedFancher`.

    Attributes
    ----------
    prior:
        Of the number, or of its logarithm or logit.
    value:
        From that to the number.
    """

    prior: NormalPrior
    value: Callable[[Float[Array, ""]], Float[Array, ""]]


def _itself(value: Float[Array, ""]) -> Float[Array, ""]:
    return value


#: Extensions of Fancher's law, by the names of their fields.
EXTENSIONS: dict[str, Extension] = {
    "relaxing_share": Extension(
        NormalPrior(0.0, 0.05, "up to a tenth of k; a negative share is unphysical, and what noise makes of none"),
        _itself,
    ),
    "relaxation_s": Extension(
        NormalPrior(np.log(0.008), 0.7, "2 to 32 ms: rubber that relaxes while a step rises and rings"), jnp.exp
    ),
    "friction_change": Extension(
        NormalPrior(0.0, 0.1, "up to a fifth less or more friction at speed than at rest"), _itself
    ),
    "friction_speed_mm_per_s": Extension(
        NormalPrior(np.log(30.0), 0.7, "8 to 120 mm/s: what a step's travel and ring reach"), jnp.exp
    ),
    "growth_per_mm": Extension(
        NormalPrior(0.0, 0.03, "up to 6 % of the slope a mm: by half over the travel of a step"), _itself
    ),
    "yield_spread": Extension(
        NormalPrior(-1.0, 1.0, "0.05 to 0.7: from nearly one yield displacement to two, one five times the other"),
        jax.nn.sigmoid,
    ),
}


class MotionLaw(eqx.Module):
    """A force law and its parameters. A pytree without leaves: jitted functions take it as a static argument.

    Attributes
    ----------
    name:
        Value of the option `motion --law`.
    tyre_parameters:
        The tyre's parameters whose logarithms are sampled, in order; names of `TYRE_PRIORS`, k first.
    reported:
        The parameters that estimates report instead, in the same order: fields of the law.
    law:
        The law's class; its fields are `reported` and C.
    extensions:
        Names of `EXTENSIONS`: a record's tyre then follows `ExtendedFancher`, and `law` is what is left of that
        without them.
    averaged:
        Names of the laws that a record's estimate is averaged over, by their evidence; empty: it is of this law.
    pools:
        Name of the average whose records' estimates are weighted anew, by the evidence of all records of a
        configuration; empty: they stay.
    """

    name: str = eqx.field(static=True)
    tyre_parameters: tuple[str, ...] = eqx.field(static=True)
    reported: tuple[str, ...] = eqx.field(static=True)
    law: Callable[..., StatefulLaw] = eqx.field(static=True)
    extensions: tuple[str, ...] = eqx.field(static=True, default=())
    averaged: tuple[str, ...] = eqx.field(static=True, default=())
    pools: str = eqx.field(static=True, default="")

    @property
    def of_records(self) -> str:
        """Name of the law that each record by itself is fitted by."""
        return self.pools or self.name

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters of records and cases in the hierarchy: the tyre's, mass and damping."""
        return (*self.tyre_parameters, *AXLE_PARAMETERS)

    @property
    def reported_parameters(self) -> tuple[str, ...]:
        """Parameters that a record's estimate reports, in the same order."""
        return (*self.reported, *AXLE_PARAMETERS)

    @property
    def has_friction(self) -> bool:
        """Whether the law itself dissipates energy; otherwise only the damper does."""
        return "settled" in self.tyre_parameters

    def from_logs(self, logs: Float[Array, " parameters"], C: ScalarLike = 0.0) -> StatefulLaw:
        """Return the law from the logarithms of its parameters, shape (parameters,); those of the axle are ignored."""
        values = dict(zip(self.tyre_parameters, jnp.exp(logs), strict=False))
        if "x" in self.reported:
            values["x"] = values.pop("settled") + values["k"] * values["beta"]
        return self.law(**values, C=C)

    def from_reported(self, values: Float[Array, " parameters"], C: ScalarLike = 0.0) -> StatefulLaw:
        """Return the law from its reported parameters, shape (parameters,); those of the axle are ignored."""
        return self.law(**dict(zip(self.reported, values, strict=False)), C=C)


def extended(
    law: Fancher, values: dict[str, Float[Array, ""]], ends_mm: tuple[ScalarLike, ScalarLike]
) -> ExtendedFancher:
    """Return Fancher's law with extensions.

    Parameters
    ----------
    law:
        Fancher's.
    values:
        What the priors of `EXTENSIONS` are of, by name.
    ends_mm:
        Displacement on flat ground before and after the step, mm.
    """
    fields = {name: EXTENSIONS[name].value(value) for name, value in values.items()}
    return ExtendedFancher(k=law.k, C=law.C, x=law.x, beta=law.beta, ends_mm=ends_mm, **fields)


# Between two samples a tyre moves by less than beta. One integration step of Bouc-Wen's law instead of four changes
# readings by 0.003 of their noise, and a fit takes a seventh of the time.
_bouc_wen = partial(BoucWen, substeps=1)
_FRICTION = ("k", "settled", "beta")
_RING = ("k", "belt_frequency", "belt_damping", "sidewall_ratio")
_REPORTED = ("k", "x", "beta")
FANCHER = MotionLaw("fancher", _FRICTION, _REPORTED, Fancher)
KELVIN_VOIGT = MotionLaw("kelvin_voigt", ("k",), ("k",), KelvinVoigt)
_EXTENDED = {
    "relaxing": ("relaxing_share", "relaxation_s"),
    "speed_friction": ("friction_change", "friction_speed_mm_per_s"),
    "stiffening": ("growth_per_mm",),
    "two_yields": ("yield_spread",),
}
_AVERAGED = (FANCHER.name, *_EXTENDED)
#: Laws by name, the thesis's first; those that extend it, and their averages, last.
MOTION_LAWS: dict[str, MotionLaw] = {
    law.name: law
    for law in (
        FANCHER,
        KELVIN_VOIGT,
        MotionLaw("bouc_wen", (*_FRICTION, "n"), (*_FRICTION, "n"), _bouc_wen),
        MotionLaw("maxwell_slip", _FRICTION, _FRICTION, MaxwellSlip),
        MotionLaw("rigid_ring", _RING, _RING, RigidRing),
        *(MotionLaw(name, _FRICTION, _REPORTED, Fancher, own) for name, own in _EXTENDED.items()),
        MotionLaw("auto", _FRICTION, _REPORTED, Fancher, averaged=_AVERAGED),
        MotionLaw("auto_campaign", _FRICTION, _REPORTED, Fancher, averaged=_AVERAGED, pools="auto"),
    )
}


def motion_law(name: str) -> MotionLaw:
    """Return a law by its name.

    Raises
    ------
    BadInput
        If no law has this name.
    """
    if name not in MOTION_LAWS:
        raise BadInput(f"law {name!r} is unknown; use {', '.join(MOTION_LAWS)}")
    return MOTION_LAWS[name]
