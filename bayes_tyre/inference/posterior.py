"""What a posterior holds: the name, the dimension and the unit of every quantity kept of the models' sites."""

from collections.abc import Mapping

import arviz as az
import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.levels import Levels
from bayes_tyre.record import WORDS

#: Units by parameter; the parameters that a record has.
RECORD_UNITS = {"k": "kN/mm", "beta": "mm", "J": "kN", "C": "kN", "F_i": "kN", "sigma": "kN"}
#: Parameters that a case has.
CASE_PARAMETERS = ("k", "beta")


def _quantities() -> dict[str, tuple[str | None, str]]:
    """Return dimension (None: a scalar) and unit (empty: a pure number) by name."""
    kept: dict[str, tuple[str | None, str]] = {name: ("record", unit) for name, unit in RECORD_UNITS.items()}
    kept["discordant_probability"] = ("record", "")
    for name in CASE_PARAMETERS:
        kept[f"{name}_case"] = ("case", RECORD_UNITS[name])
        kept[f"{name}_cell"] = ("cell", RECORD_UNITS[name])
        for factor in ("speed", "load", "step", "direction_step"):
            kept[f"log_{name}_{factor}"] = (factor, "")
            kept[f"log_{name}_{factor}_scale"] = (None, "")
        kept[f"log_{name}_case_scale"] = (None, "")
        kept[f"log_{name}_repeat_scatter"] = (None, "")
        kept[f"log_{name}_scatter_spread"] = (None, "")
        kept[f"log_{name}_repeat_scatter_by_speed"] = ("speed", "")
        kept[f"published_scatter_{name}"] = (None, "")
    kept |= {"discordant_weight": (None, ""), "log_sigma_spread": (None, "")}
    kept |= {"J_scale": (None, "kN"), "sigma_typical": (None, "kN")}
    return kept


QUANTITIES = _quantities()


def to_datatree(
    draws: Mapping[str, np.ndarray],
    statistics: Mapping[str, np.ndarray],
    levels: Levels,
    words: pd.DataFrame,
    attributes: Mapping[str, str],
) -> xr.DataTree:
    """Return draws as an ArviZ DataTree with named dimensions, labels, words and units.

    Parameters
    ----------
    draws:
        By site, shape (chains, draws, ...); sites that `QUANTITIES` does not name are left out.
    statistics:
        By name as ArviZ has them (`diverging`, `energy`, ...), shape (chains, draws).
    levels, words:
        What the cases, records and groupings are called; `words` has a row a record, or none.
    attributes:
        Put on the root: origin of the data, the model.
    """
    kept = {name: np.asarray(draws[name]) for name in QUANTITIES if name in draws}
    groupings = {name: getattr(levels, name).labels for name in ("cell", "speed", "load", "step", "direction_step")}
    coordinates = {"case": [case.label for case in levels.cases], "record": list(words["record"]), **groupings}
    tree = az.from_dict(
        {"posterior": kept, "sample_stats": dict(statistics)},
        coords={name: np.asarray(labels) for name, labels in coordinates.items() if len(labels)},
        dims={name: [dim] for name in kept if (dim := QUANTITIES[name][0])},
    )
    posterior = _with_words(tree["posterior"].to_dataset(), levels, words)
    for name in kept:
        posterior[name].attrs["units"] = QUANTITIES[name][1] or "1"
    tree["posterior"] = xr.DataTree(posterior)
    tree.attrs.update(attributes)
    return tree


def _with_words(posterior: xr.Dataset, levels: Levels, words: pd.DataFrame) -> xr.Dataset:
    """Return the posterior with the words as labels along its cases and records."""
    cases = pd.DataFrame(levels.cases)
    for dim, table in (("case", cases), ("record", words)):
        if dim in posterior.dims:
            columns = [word for word in WORDS if word in table]
            posterior = posterior.assign_coords(
                {f"{dim}_{word}": (dim, np.asarray(table[word].tolist())) for word in columns}
            )
    return posterior
