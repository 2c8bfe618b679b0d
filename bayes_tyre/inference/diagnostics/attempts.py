"""What comes after sampling, run so that none of it that fails loses the draws: a failure becomes a failed check."""

import json
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.plain_text import reason

#: Attributes of a posterior's tree with checks, as JSON: those that failed because something could not be computed, and
#: those of the model against the records' points.
FAILED, MODEL_CHECKS = "failed_checks", "model_checks"
_REPORT = "the draws are kept: report this line as a fault of bayes-tyre"


@runtime_checkable
class Attempt(Protocol):
    """Runs what is named and returns what it returns; where it may fail, `otherwise`."""

    def __call__[T](
        self, name: str, compute: Callable[[], T], otherwise: T, *, kind: str = ..., remedy: str = ...
    ) -> T:
        """Return what `compute` returns; `kind` and `remedy` are those of the check that failing makes of it."""
        ...


def directly[T](name: str, compute: Callable[[], T], otherwise: T, *, kind: str = "", remedy: str = "") -> T:
    """Run it, and let what it raises pass: the `Attempt` of whoever has no draws to lose."""
    del name, otherwise, kind, remedy
    return compute()


class Attempts:
    """The `Attempt` of a result in the making: holds each failure as a failed check.

    Bad input, and a disk that refuses a file, end the command as ever: the checkpoints hold the draws then.
    """

    def __init__(self) -> None:
        self.failed: list[Check] = []

    def __call__[T](
        self, name: str, compute: Callable[[], T], otherwise: T, *, kind: str = "model", remedy: str = _REPORT
    ) -> T:
        """Return what `compute` returns, or `otherwise` where it raises, as `Attempt` says."""
        try:
            return compute()
        except (BadInput, OSError):
            raise
        except Exception as error:
            text = reason(error)
            what = text if text == type(error).__name__ else f"{type(error).__name__}: {text}"
            self.failed.append(Check(name, kind, False, np.nan, np.nan, what, f"{name} failed: {what}", remedy))
            return otherwise


def with_checks(tree: xr.DataTree, name: str, checks: Sequence[Check]) -> xr.DataTree:
    """Return the posterior with checks in its attribute of this name, for `checks_in`."""
    with_all = tree.copy()
    with_all.attrs[name] = json.dumps([check._asdict() for check in checks])
    return with_all


def checks_in(tree: xr.DataTree, name: str) -> list[Check]:
    """Return the checks that `with_checks` put into a posterior's attributes; none where it did not."""
    stored: list[dict[str, Any]] = json.loads(tree.attrs.get(name, "[]"))
    return [Check(**check) for check in stored]
