"""Made-up results of the study of motions: every estimate 1 % high, with a standard deviation of 1 %."""

import pandas as pd

from bayes_tyre.inference.motion.record.estimate import RECORD_PARAMETERS
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.studies.motion_study import StudyRecord


def motion_rows(records: list[StudyRecord]) -> pd.DataFrame:
    """Return a row a record and parameter."""
    return pd.DataFrame(
        {"mismatch": record.mismatch, "kind": record.kind, "record": record.plan.record, "seed": 1}
        | {"parameter": name, "unit": RECORD_UNITS[name], "truth": 1.0}
        | {"estimate": 1.01, "sd": 0.0101, "lower": 0.99, "upper": 1.03}
        | {"inside": True, "error_percent": 1.0, "pareto_k": 0.1, "cpu_seconds": 2.0, "status": "ok"}
        for record in records
        for name in RECORD_PARAMETERS
    )
