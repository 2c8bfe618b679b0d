"""The motions that a result shows: readings of the worst and of a typical record, from the cached estimates."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.results.motion_traces import COLUMNS, places
from bayes_tyre.workflow.raw.motion_estimates import MISFIT, OK, READINGS, TOLD


def shown_motions(parts: Sequence[Path]) -> pd.DataFrame | None:
    """Return the readings of a few records that parts hold: `TOLD`, `shown` (a place), and `COLUMNS`.

    None where an earlier version wrote the parts, without readings.
    """
    try:
        records = pd.concat([pd.read_parquet(part, columns=[*TOLD, MISFIT]) for part in parts], ignore_index=True)
        shown = places((records["status"] == OK).to_numpy(), records[MISFIT].to_numpy(float))
        readings_at = {
            place: pd.read_parquet(parts[i], columns=[READINGS])[READINGS].iloc[0] for place, i in shown.items()
        }
    except (KeyError, ValueError):
        return None
    blocks = []
    for place, flat in readings_at.items():
        readings = pd.DataFrame(np.reshape(flat, (-1, len(COLUMNS))), columns=list(COLUMNS))
        readings = readings.assign(shown=place, **{name: records[name].iloc[shown[place]] for name in TOLD})
        blocks.append(readings[["record", "configuration", "shown", *COLUMNS, "status", "origin"]])
    return pd.concat(blocks, ignore_index=True)
