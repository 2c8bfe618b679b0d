"""What may fail after sampling: errors of code become failed checks, all others end the command as ever."""

import numpy as np
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.attempts import FAILED, Attempts, checks_in, directly, with_checks


def raises(error: BaseException) -> object:
    raise error


def test_what_works_is_returned_and_leaves_no_check():
    attempts = Attempts()
    assert attempts("sum", lambda: 1 + 1, 0) == directly("sum", lambda: 1 + 1, 0) == 2
    assert attempts.failed == []


def test_what_fails_becomes_a_failed_check_with_its_reason_and_the_next_goes_on():
    attempts = Attempts()
    assert attempts("power scaling", lambda: raises(ValueError("All tail\nvalues")), 7, kind="sampling") == 7
    assert attempts("contrasts.png", lambda: raises(KeyError("log_sigma")), None, remedy="measure more") is None
    assert attempts("bare", lambda: raises(ZeroDivisionError()), 1) == 1
    first, second, third = attempts.failed
    assert (first.name, first.kind, first.passed) == ("power scaling", "sampling", False)
    assert first.where == "ValueError: All tail values"
    assert second.reason == "contrasts.png failed: KeyError: 'log_sigma'; measure more"
    assert third.where == "ZeroDivisionError"


@pytest.mark.parametrize("error", [BadInput("no; do"), OSError(28, "full"), KeyboardInterrupt(), SystemExit(1)])
def test_bad_input_a_full_disk_and_an_interrupt_are_left_as_they_are(error):
    attempts = Attempts()
    with pytest.raises(type(error)):
        attempts("table", lambda: raises(error), None)
    assert attempts.failed == []


def test_a_posterior_carries_its_failed_checks():
    factor_table = grid(("single",))
    tree = posterior(scattered(factor_table, seed=1, chains=2, draws=20), factor_table)
    attempts = Attempts()
    attempts("power scaling", lambda: raises(ValueError("x")), None, kind="sampling")
    (found,) = checks_in(with_checks(tree, FAILED, attempts.failed), FAILED)
    # NaN is no equal of itself: the numbers are compared as text.
    assert repr(found) == repr(attempts.failed[0])
    assert checks_in(with_checks(tree, FAILED, []), FAILED) == checks_in(tree, FAILED) == []
    assert np.isfinite(tree["posterior"]["k_case"].to_numpy()).all()
