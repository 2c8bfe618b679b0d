"""Fits whose draws are put there instead of sampled: all that is written of them is real, and quick."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import here, small, written
from helpers.hand_made_posteriors import posterior, scattered

from bayes_tyre.inference.diagnostics.judge import undiagnosed
from bayes_tyre.record_table import record_factors
from bayes_tyre.report.figures import catalogue
from bayes_tyre.workflow import fit as workflow


def drawn(table: pd.DataFrame, *_: object) -> xr.DataTree:
    """Return well-mixed draws for a record table, not of its records: residuals correlate, and the verdict fails."""
    factor_table = record_factors(table)
    draws = scattered(factor_table, seed=4)
    scatter = {f"sd_log_{name}_repeat": sd * draws["sd_J"] for name, sd in (("k", 0.1), ("beta", 0.2))}
    return posterior({**draws, **scatter}, factor_table)


def put_draws_for_the_sampler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "fit_hierarchical", drawn)


def put_a_fit_without_checks_and_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    put_draws_for_the_sampler(monkeypatch)
    monkeypatch.setattr(workflow, "judge", lambda tree, *_: (tree, undiagnosed(tree)))
    monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))


def write_result(folder: Path, figures: bool = False) -> Path:
    """Write what `fit` writes of the small table into a folder, figures (some seconds) if asked for; return it."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        put_draws_for_the_sampler(monkeypatch)
        if not figures:
            monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        table = written(small(), folder.with_name(f"{folder.name}.csv"))
        done = here("fit", table, "--out", folder, "--quiet")
    assert done.exit_code == 4, done.stderr
    return folder


def once[**P, T](compute: Callable[P, T]) -> Callable[P, T]:
    """Return a function that computes the first time it is called, and then gives the same: runs are of one input."""
    results: list[T] = []

    def computed(*arguments: P.args, **options: P.kwargs) -> T:
        if not results:
            results.append(compute(*arguments, **options))
        return results[0]

    return computed
