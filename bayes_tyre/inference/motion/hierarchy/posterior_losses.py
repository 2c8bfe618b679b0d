"""What records and cases lose in a cycle of a stated amplitude at the wheel centre, at every draw of a posterior."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import ArrayLike, Float

from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw, motion_law
from bayes_tyre.inference.motion.record.energy import Losses, losses_of_told
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig.axle import Rig

#: What `with_losses` adds of records, and of cases: name, unit, field of `Losses`.
OF_RECORDS = (("energy_per_cycle", "J", "energy_J"),)
OF_CASES = (
    *OF_RECORDS,
    ("loss_factor", "1", "loss_factor"),
    ("equivalent_damping", "kN s/mm", "damping_kN_s_per_mm"),
    ("separation", "kN", "separation_kN"),
)


class Middle(NamedTuple):
    """Where a cycle goes on: the rig, and the displacement at its middle, mm at the wheel centre."""

    rig: Rig
    displacement_mm: float


def with_losses(
    tree: xr.DataTree, factor_table: pd.DataFrame, of_records: Sequence[Middle], amplitude_mm: float
) -> xr.DataTree:
    """Return a posterior with the energy per cycle of records and cases, and the cases' loss factor and damping.

    Parameters
    ----------
    tree, words:
        Of `bayes_tyre.inference.motion.hierarchy.model.fit_motions`, and the words that it was given.
    of_records:
        A middle a record. A case's cycle is about the median of its records' middles, on the rig of the first.
    amplitude_mm:
        Half the stroke at the wheel centre; it stands in the attributes.
    """
    posterior, factors = tree["posterior"].to_dataset(), find_factors(factor_table)
    law = motion_law(tree.attrs.get("law", FANCHER.name))
    of_cases = []
    for case in range(len(factors.cases)):
        mine = [of_records[int(record)] for record in np.flatnonzero(factors.of_record == case)]
        of_cases.append(Middle(mine[0].rig, float(np.median([middle.displacement_mm for middle in mine]))))
    found = _found(posterior, law, ("record", ""), of_records, OF_RECORDS, amplitude_mm)
    # Without friction there are no branches to be apart.
    wanted = [one for one in OF_CASES if law.has_friction or one[0] != "separation"]
    found |= _found(posterior, law, ("case", "_case"), of_cases, wanted, amplitude_mm)
    with_all = tree.copy()
    with_all["posterior"] = xr.DataTree(posterior.assign(found))
    with_all.attrs["amplitude_mm"] = amplitude_mm
    return with_all


def _found(
    posterior: xr.Dataset,
    law: MotionLaw,
    of: tuple[str, str],
    middles: Sequence[Middle],
    wanted: Sequence[tuple[str, str, str]],
    amplitude_mm: float,
) -> dict[str, xr.DataArray]:
    """Return what is wanted of the losses of each record or case (dimension, ending of its names), by its name."""
    dim, ending = of
    named = [posterior[f"{name}{ending}"].transpose("chain", "draw", dim) for name in law.told_parameters]
    values = np.stack([value.to_numpy() for value in named], axis=-1)
    each = [
        _of_draws(middle.rig, law, values[:, :, i].reshape(-1, values.shape[-1]), middle.displacement_mm, amplitude_mm)
        for i, middle in enumerate(middles)
    ]
    like = posterior[f"k{ending}"].transpose("chain", "draw", dim)
    found = {}
    for name, unit, field in wanted:
        stacked = np.stack([np.asarray(getattr(one, field)) for one in each], axis=-1).reshape(like.shape)
        found[f"{name}{ending}"] = like.copy(data=stacked).assign_attrs(units=unit, amplitude_mm=amplitude_mm)
    return found


@functools.partial(jax.jit, static_argnums=0)
def _of_draws(
    rig: Rig, law: MotionLaw, told: Float[ArrayLike, "draws p"], displacement_mm: ScalarLike, amplitude_mm: ScalarLike
) -> Losses:
    # The line through first touch: C moves the middle by tenths of a mm, and no loss.
    return jax.vmap(lambda one: losses_of_told(rig, law, one, displacement_mm, amplitude_mm))(jnp.asarray(told))
