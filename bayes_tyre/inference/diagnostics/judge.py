"""From draws to the verdict, whatever of what is computed on the way fails."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from bayes_tyre.inference.diagnostics.attempts import Attempt, Attempts
from bayes_tyre.inference.diagnostics.convergence import with_figures
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.diagnostics.verdict import Diagnostics, diagnose


def judge(
    tree: xr.DataTree,
    identify: Callable[[xr.DataTree, Attempt], xr.DataTree],
    attempts: Attempts,
    autocorrelation: Callable[[xr.DataTree], float] = lambda _: np.nan,
) -> tuple[xr.DataTree, Diagnostics]:
    """Return a posterior with what its tables need beside the draws, and the verdict on it.

    Parameters
    ----------
    tree:
        The draws.
    identify:
        Adds what decides each quantity (`bayes_tyre.inference.diagnostics.power_scaling`).
    attempts:
        What failed before, and then here too.
    autocorrelation:
        Lag-1 autocorrelation of the residuals of a posterior, where there are records.
    """
    tree = attempts("prior sensitivity", lambda: identify(tree, attempts), tree)
    tree = attempts("convergence statistics", lambda: with_figures(tree), tree, kind="sampling")
    rho = attempts("autocorrelation of residuals", lambda: autocorrelation(tree), np.nan)
    found = attempts("diagnostics", lambda: diagnose(tree, rho), undiagnosed(tree), kind="sampling")
    return tree, with_failures(found, attempts.failed)


def undiagnosed(tree: xr.DataTree) -> Diagnostics:
    """Return diagnostics without statistics, for draws that `diagnose` could not take."""
    statistics, nan = tree["sample_stats"].to_dataset(), np.nan
    chains, draws = (tree["posterior"].sizes[dim] for dim in ("chain", "draw"))
    return Diagnostics("fail", (), nan, nan, nan, int(statistics["diverging"].sum()), nan, draws, chains, nan)


def with_failures(diagnostics: Diagnostics, failed: list[Check]) -> Diagnostics:
    """Return the verdict with what could not be computed, drawn or written as failed checks; each of a name once."""
    new = {check.name: check for check in failed if check.name not in {one["name"] for one in diagnostics.checks}}
    if not new:
        return diagnostics
    reasons = (*diagnostics.reasons, *(check.reason for check in new.values()))
    checks = [*diagnostics.checks, *(check.row for check in new.values())]
    return diagnostics._replace(verdict="fail", reasons=reasons, checks=checks)
