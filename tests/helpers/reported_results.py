"""Results on disk for the report: hand-made draws in the files that `fit` writes, without its figures."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import here
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.quick_fits import put_draws_for_the_sampler
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.convergence import with_statistics
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.report.answer.load import Reported, read_reported
from bayes_tyre.report.figures import catalogue
from bayes_tyre.results.provenance import begin_run
from bayes_tyre.workflow.result_folder import write_fit
from bayes_tyre.workflow.result_names import names

SCRIPT, IMAGE = "<script>alert(1)</script>", '"><img src=x onerror=alert(2)>'
REASON = "k[x]: R-hat 1.2 is above 1.01: chains disagree; raise --warmup and --draws"


def write_made(
    folder: Path,
    stiffness: Mapping[str, float],
    *,
    spread: float = 0.02,
    verdict: str = "pass",
    origin: str = "measured",
    factor_table: pd.DataFrame | None = None,
    repeats: int = 1,
    seed: int = 3,
) -> Path:
    """Write a result in which k of every case is `stiffness` of its configuration, loading 10 % above unloading.

    The logarithm of each configuration's k has the standard deviation `spread`.
    """
    factor_table = grid(tuple(stiffness), repeats) if factor_table is None else factor_table
    cases = find_factors(factor_table).cases
    rng = np.random.default_rng(seed)
    draws = scattered(factor_table, seed)
    if "record" not in factor_table:  # of printed tables
        draws = {name: values for name, values in draws.items() if QUANTITIES[name][0] != "record"}
    common = {name: np.exp(spread * rng.normal(size=(4, 250))) for name in sorted(stiffness)}
    way = {"loading": 1.1, "unloading": 1.0}
    k = [stiffness[c.configuration] * way.get(c.direction, 1.0) * common[c.configuration] for c in cases]
    tree = with_statistics(posterior({**draws, "k_case": np.stack(k, axis=-1)}, factor_table, origin=origin))
    judged = diagnose(tree)._replace(verdict=verdict, reasons=(REASON,) if verdict == "fail" else ())
    folder.mkdir(parents=True)
    given = folder / "given.txt"
    given.write_text(f"{stiffness} {seed}")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        run = begin_run(["fit", "given.txt", "--out", "made"], {"chains": 4}, seed, [given], origin)
        write_fit(catalogue.Result(tree, judged.verdict), judged, run, folder)
    return folder


def printed_factors(*configurations: str) -> pd.DataFrame:
    """Return the words of printed cases: without records."""
    return grid(configurations, 1).drop(columns=["record", "repeat"])


def made(folder: Path, stiffness: Mapping[str, float], **how) -> Reported:
    """Return such a result as the report reads it."""
    return read_reported(write_made(folder, stiffness, **how), names([folder])[0])


def write_fitted(folder: Path, configurations: tuple[str, ...] = ("single", SCRIPT)) -> Path:
    """Write what `fit` writes of simulated records with odd names, draws put there and figures left out."""
    table = simulate(Plan(configurations, (0.0,), (20.0,), repeats=3, points=30), 1)[0]
    table.loc[table["record"] == table["record"].iloc[0], "record"] = IMAGE
    folder.mkdir(parents=True)
    table.to_csv(folder / "records.csv", index=False)
    with pytest.MonkeyPatch.context() as monkeypatch:
        put_draws_for_the_sampler(monkeypatch)
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        done = here("fit", folder / "records.csv", "--out", folder, "--quiet")
    assert done.exit_code == 4, done.stderr
    return folder
