"""The tasks of raw files: rows of a table of cases that are of none of them."""

import pandas as pd
import pytest

from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.workflow.raw.process_tasks import Settings, plan_tasks

FACTORS = {"configuration": "single", "speed_km_h": 0, "initial_load_kN": 20, "step_kN": 10, "repeat": 1}


def test_rows_of_no_file_are_said_because_a_misspelt_name_would_be_read_from_the_file(tmp_path):
    files, cases = [tmp_path / "DynamicD(0)20-30(1).lvm"], tmp_path / "cases.csv"
    pd.DataFrame({"file": ["dynamicd(0)20-30(1).lvm"], **FACTORS}).to_csv(cases, index=False)
    with pytest.warns(UserWarning, match=r"no file was given for 1 of its rows: 'dynamicd\(0\)20-30\(1\).lvm'"):
        (task,) = plan_tasks(files, Settings(None, cases, "inertia"))
    assert isinstance(task.factors, RecordFactors)
    assert task.factors.case.configuration == "dual"
    pd.DataFrame({"file": [files[0].name], **FACTORS}).to_csv(cases, index=False)
    (task,) = plan_tasks(files, Settings(None, cases, "inertia"))
    assert isinstance(task.factors, RecordFactors)
    assert task.factors.case.configuration == "single"
