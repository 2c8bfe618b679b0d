"""Losses and stiffness of records and cases in cycles of a given amplitude, at every posterior draw."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.motion.cycle.energy import losses_from_reported
from bayes_tyre.inference.motion.cycle.stiffness import stiffnesses_from_reported
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw, motion_law
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.record import RING_DOWN_MM
from bayes_tyre.rig.axle import Rig

#: The one quantity that is not of a cycle of the amplitude asked for.
RING_DOWN = "ring_down_stiffness"
#: Quantities that `with_losses` adds for records and for cases: name, unit, field of `Losses` or of `Stiffnesses`.
OF_RECORDS = (("energy_per_cycle", "J", "energy_J"),)
OF_CASES = (
    *OF_RECORDS,
    ("loss_factor", "1", "loss_factor"),
    ("equivalent_damping", "kN s/mm", "damping_kN_s_per_mm"),
    ("separation", "kN", "separation_kN"),
    ("static_stiffness", "kN/mm", "static_kN_per_mm"),
    ("stiffness_at_1_Hz", "kN/mm", "one_Hz_kN_per_mm"),
    (RING_DOWN, "kN/mm", "ring_down_kN_per_mm"),
)


class Middle(NamedTuple):
    """The middle of a cycle: the rig, and the displacement, mm at the wheel centre."""

    rig: Rig
    displacement_mm: float


def with_losses(
    tree: xr.DataTree, factor_table: pd.DataFrame, of_records: Sequence[Middle], amplitude_mm: float
) -> xr.DataTree:
    """Return a posterior with the energy per cycle of records and cases, and the cases' other losses and stiffness.

    Parameters
    ----------
    tree, factor_table:
        The result of `bayes_tyre.inference.motion.hierarchy.model.fit_motions`, and its factor table.
    of_records:
        One middle for each record. A case's cycle is about the median of its records' middles, on the rig of the first.
    amplitude_mm:
        Half the stroke at the wheel centre, mm; stored in the attributes.
    """
    posterior, factors = tree["posterior"].to_dataset(), find_factors(factor_table)
    law = motion_law(tree.attrs.get("law", FANCHER.name))
    of_cases = []
    for case in range(len(factors.cases)):
        middles = [of_records[int(record)] for record in np.flatnonzero(factors.of_record == case)]
        of_cases.append(Middle(middles[0].rig, float(np.median([middle.displacement_mm for middle in middles]))))
    losses = _losses(posterior, law, ("record", ""), of_records, OF_RECORDS, amplitude_mm)
    # Without friction there are no separate branches.
    wanted = [quantity for quantity in OF_CASES if law.has_friction or quantity[0] != "separation"]
    losses |= _losses(posterior, law, ("case", "_case"), of_cases, wanted, amplitude_mm)
    with_all = tree.copy()
    with_all["posterior"] = xr.DataTree(posterior.assign(losses))
    with_all.attrs["amplitude_mm"] = amplitude_mm
    return with_all


def _losses(
    posterior: xr.Dataset,
    law: MotionLaw,
    units: tuple[str, str],
    middles: Sequence[Middle],
    wanted: Sequence[tuple[str, str, str]],
    amplitude_mm: float,
) -> dict[str, xr.DataArray]:
    """Return the wanted losses of each record or case (`units`: dimension, ending of its names), by name."""
    dim, ending = units
    named = [posterior[f"{name}{ending}"].transpose("chain", "draw", dim) for name in law.reported_parameters]
    values = np.stack([value.to_numpy() for value in named], axis=-1)
    each = [
        _of_draws(
            *(middle.rig, law, values[:, :, i].reshape(-1, values.shape[-1]), middle.displacement_mm, amplitude_mm),
            with_stiffness=dim == "case",
        )
        for i, middle in enumerate(middles)
    ]
    template = posterior[f"k{ending}"].transpose("chain", "draw", dim)
    arrays = {}
    for name, unit, field in wanted:
        stacked = np.stack([np.asarray(one[field]) for one in each], axis=-1).reshape(template.shape)
        of_cycle = RING_DOWN_MM if name == RING_DOWN else amplitude_mm
        arrays[f"{name}{ending}"] = template.copy(data=stacked).assign_attrs(units=unit, amplitude_mm=of_cycle)
    return arrays


@functools.partial(jax.jit, static_argnames=("rig", "with_stiffness"))
def _of_draws(
    rig: Rig,
    law: MotionLaw,
    values: Float[ArrayLike, "draws p"],
    displacement_mm: ScalarLike,
    amplitude_mm: ScalarLike,
    with_stiffness: bool,
) -> dict[str, Float[Array, " draws"]]:
    """Return losses, and the cases' stiffnesses, by field."""

    def of_one(one: Float[Array, " p"]) -> dict[str, Float[Array, ""]]:
        # C, which moves the middle by tenths of a mm and causes no loss, is 0.
        cycle = rig, law, one, displacement_mm, amplitude_mm
        energies = losses_from_reported(*cycle)._asdict()
        return energies | (stiffnesses_from_reported(*cycle)._asdict() if with_stiffness else {})

    return jax.vmap(of_one)(jnp.asarray(values))
