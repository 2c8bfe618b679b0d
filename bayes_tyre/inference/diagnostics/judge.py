"""From draws to the verdict, whatever of what is computed on the way fails."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.diagnostics.attempts import MODEL_CHECKS, Attempt, Attempts, with_checks
from bayes_tyre.inference.diagnostics.convergence import with_statistics
from bayes_tyre.inference.diagnostics.repeat_checks import repeat_checks
from bayes_tyre.inference.diagnostics.residual_checks import residual_checks
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.diagnostics.verdict import Diagnostics, diagnose
from bayes_tyre.runtime import return_freed_memory


def judge(
    tree: xr.DataTree,
    identify: Callable[[xr.DataTree, Attempt], xr.DataTree],
    attempts: Attempts,
    table: pd.DataFrame | None = None,
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
    table:
        The points that the posterior was fitted to, where it is of records.
    """
    tree = attempts("prior sensitivity", lambda: identify(tree, attempts), tree)
    tree = attempts("convergence statistics", lambda: with_statistics(tree), tree, kind="sampling")
    if table is not None:
        tree = attempts("model checks", lambda: with_checks(tree, MODEL_CHECKS, model_checks(tree, table)), tree)
    diagnostics = attempts("diagnostics", lambda: diagnose(tree), undiagnosed(tree), kind="sampling")
    return_freed_memory()
    return tree, with_failures(diagnostics, attempts.failed)


def model_checks(tree: xr.DataTree, table: pd.DataFrame) -> list[Check]:
    """Return the checks of a posterior of records against their points, and of its cases against their repeats."""
    return [*residual_checks(tree, table), *repeat_checks(tree["posterior"].to_dataset())]


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
