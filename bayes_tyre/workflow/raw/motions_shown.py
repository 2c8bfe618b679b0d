"""Which records' motions a result shows: every part keeps its readings, and the worst and a typical one are taken."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.results.motion_traces import COLUMNS, places
from bayes_tyre.workflow.raw.motion_estimates import MISFIT, OK, READINGS, TOLD


def shown_motions(parts: Sequence[Path]) -> pd.DataFrame | None:
    """Return the readings of a few records that parts hold: `TOLD`, `shown` (a place), and `COLUMNS`.

    None where parts hold none, for an earlier version wrote them.
    """
    try:
        known = pd.concat([pd.read_parquet(part, columns=[*TOLD, MISFIT]) for part in parts], ignore_index=True)
        shown = places((known["status"] == OK).to_numpy(), known[MISFIT].to_numpy(float))
        kept = {place: pd.read_parquet(parts[i], columns=[READINGS])[READINGS].iloc[0] for place, i in shown.items()}
    except (KeyError, ValueError):
        return None
    blocks = []
    for place, flat in kept.items():
        readings = pd.DataFrame(np.reshape(flat, (-1, len(COLUMNS))), columns=list(COLUMNS))
        readings = readings.assign(shown=place, **{name: known[name].iloc[shown[place]] for name in TOLD})
        blocks.append(readings[["record", "configuration", "shown", *COLUMNS, "status", "origin"]])
    return pd.concat(blocks, ignore_index=True)
