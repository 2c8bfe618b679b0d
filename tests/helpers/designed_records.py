"""Records of a simulated design as `fit` prepares a user's, without anything estimated from their forces."""

import numpy as np

from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_batch
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.studies.design import Design


def prepared(design: Design, force_kN: np.ndarray, model: ModelSettings) -> PreparedRecords:
    """Return the records of a design with these forces, the prior of F_i about the nominal start."""
    records = prepare_batch(design.batch(force_kN), design.factor_table, design.factors, model)
    return records._replace(data=design.nominal(records.data))
