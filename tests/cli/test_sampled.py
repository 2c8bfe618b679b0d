"""The line on each kind of check: passed, failed, and what could not be made."""

from bayes_tyre.cli.sampled import _kind_summary
from bayes_tyre.inference.diagnostics.sampling_checks import Check, unchecked

SOUND = Check("law", "model", True, 0.5, 3.1, "", "", "")
FEW = unchecked("noise_along_path", 1.5, "too few points")


def test_checks_that_could_not_be_made_are_counted_beside_those_that_passed():
    assert _kind_summary("model", [SOUND.row]) == "model: passed"
    assert _kind_summary("model", [SOUND.row, FEW.row]) == "model: passed, 1 of 2 not checked"
    failed = SOUND._replace(passed=False).row
    assert _kind_summary("model", [failed, FEW.row]) == "model: 1 of 2 checks failed (law)"
    assert _kind_summary("data", [SOUND.row]) == "data: not checked"
