"""What is said of records whose estimate failed its check, or that have none."""

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid

from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.workflow.raw.motion import Estimated, with_estimates

FACTORS = grid(repeats=2, speeds=(0.0,))
SOUND = Diagnostics("pass", (), 1.0, 500.0, 500.0, 0, 0.9, 100, 4, np.nan, ("said before",))


def estimated(bad: int, rejected: int) -> Estimated:
    status = ["Pareto k 1.1"] * bad + ["ok"] * (len(FACTORS) - bad)
    nothing = np.zeros((len(FACTORS), 5))
    motions = Motions(FACTORS, np.zeros((len(FACTORS), 5, 5)), nothing, nothing, nothing)
    rows = pd.DataFrame({"file": ["f"] * rejected, "reason": ["r"] * rejected})
    return Estimated(FACTORS.assign(status=status), motions, rows, [], [])


def test_nothing_is_said_where_all_is_well():
    assert with_estimates(SOUND, estimated(0, 0)) == SOUND


@pytest.mark.parametrize(("bad", "named"), [(1, "single 0 loading 1"), (3, "unloading 1"), (4, "and 1 more")])
def test_estimates_that_failed_their_check_are_named_and_half_of_them_fail_the_verdict(bad, named):
    found = with_estimates(SOUND, estimated(bad, 0))
    said = found.reasons if bad >= len(FACTORS) / 2 else found.limitations
    assert found.verdict == ("fail" if bad >= len(FACTORS) / 2 else "pass")
    assert named in said[-1]
    assert "3 times as wide" in said[-1]
    assert found.limitations[0] == "said before"
    assert [row["kind"] for row in found.checks if not row["passed"]] == ["data"] * (found.verdict == "fail")


def test_files_without_an_estimate_are_counted():
    found = with_estimates(SOUND, estimated(0, 2))
    assert found.verdict == "pass"
    assert found.limitations[-1].startswith("2 files have no estimate")
