"""What a record's sensors read beside what its fitted motion would have them read, and of which records it is shown."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.record.model.window import Window

#: The file of a result that holds them.
MOTIONS_CSV = "motions_shown.csv"
#: A record's place among those shown.
WORST, SECOND, TYPICAL = "worst", "second_worst", "typical"


class Channel(NamedTuple):
    """A channel's name on an axis, and its columns: what was read, what was fitted, what is left over (no unit)."""

    label: str
    read: str
    fitted: str
    left: str


def _channel(name: str, unit: str, shown_unit: str, called: str = "") -> Channel:
    ends = (f"{name}_{unit}", f"fitted_{name}_{unit}", f"left_over_{name}")
    return Channel(f"{called or name} ({shown_unit})", *ends)


CHANNELS = (
    _channel("acceleration", "m_per_s2", "m/s²"),
    _channel("laser", "mm", "mm"),
    _channel("load", "kN", "kN", "cylinder load"),
)
#: The columns of a record's readings; a row a block of samples, empty where there is no reading.
COLUMNS = ("time_s", *(column for channel in CHANNELS for column in channel[1:]))
_TEXTS = ("record", "configuration", "shown", "status", "origin")


def readings_table(
    window: Window, expected: Float[np.ndarray, "3 blocks"], off: Float[np.ndarray, "3 blocks"]
) -> pd.DataFrame:
    """Return the readings of a record and its fitted motion, a row a block, columns `COLUMNS`.

    Parameters
    ----------
    window:
        Readings that were fitted, and how noisy they are.
    expected:
        What the fitted motion would have the sensors read, m/s^2, mm, kN.
    off:
        The same less the readings in standard deviations, what noise and road have alike taken out: white if law and
        noise are right (`motion_model.residuals`).
    """
    weight = np.asarray(window.weight)
    table = {"time_s": (np.arange(weight.shape[1]) + 0.5) * float(window.block_s)}
    of_channels = zip(CHANNELS, weight, np.asarray(window.readings), expected, -off, strict=True)
    for channel, weighed, *values in of_channels:
        there = [np.where(weighed > 0, value, np.nan) for value in values]
        table |= dict(zip(channel[1:], there, strict=True))
    return pd.DataFrame(table)


def places(
    trusted: Bool[np.ndarray, " records"] | Sequence[bool], misfit: Float[np.ndarray, " records"]
) -> dict[str, int]:
    """Return which records are shown, by their place: the two worst and a typical one, as far as there are so many.

    Worst are estimates that failed their check, and among these and those that did not the larger misfit; typical is
    the median misfit of what is left, of those that passed if there are any.
    """
    order = np.lexsort((misfit, ~np.asarray(trusted, dtype=bool)))  # the worst last
    worst = list(order[::-1][: min(2, len(order) - 1)])
    left = [i for i in order if i not in worst]
    passed = [i for i in left if trusted[i]] or left
    shown = dict(zip((WORST, SECOND), worst, strict=False))
    return {name: int(i) for name, i in {**shown, TYPICAL: passed[(len(passed) - 1) // 2]}.items()}


def check_readings(table: pd.DataFrame, path: str) -> pd.DataFrame:
    """Return a table read from a file, if it is what `motion` writes.

    Raises
    ------
    BadInput
        If it is not.
    """
    missing = [name for name in (*_TEXTS, *COLUMNS) if name not in table]
    not_numeric = [name for name in COLUMNS if name in table and not pd.api.types.is_numeric_dtype(table[name])]
    if missing or not_numeric or table.empty:
        raise BadInput(
            f"{path}: is not what motion writes: column {(missing + not_numeric or ['record'])[0]}; run motion again"
        )
    return table
