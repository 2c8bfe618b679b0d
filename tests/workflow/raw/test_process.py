"""Processed files together: which records say what the mass is that they share."""

import numpy as np
import pandas as pd

from bayes_tyre.workflow.raw.process import _masses


def test_the_mass_is_that_of_standing_records_where_there_are_any():
    """A rolling record whose runout could not be taken off has none, and its mass is off all the same."""
    records = pd.DataFrame(
        {
            "speed_km_h": [0.0, 15.0, 15.0],
            "runout_rms_m_per_s2": [0.0, 0.0, 0.4],
            "mass_from_record_kg": [300.0, 180.0, 250.0],
            "mass_from_record_sd_kg": [3.0, 30.0, 9.0],
        }
    )
    np.testing.assert_array_equal(_masses(records), [[300.0, 3.0]])
    np.testing.assert_array_equal(_masses(records.iloc[1:]), [[180.0, 30.0], [250.0, 9.0]])
