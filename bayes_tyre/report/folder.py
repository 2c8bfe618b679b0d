"""A result's folder: every file that a fit writes, each whole or not at all, `run.json` last."""

import hashlib
import json
import math
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pandas as pd
import xarray as xr

from bayes_tyre.formats.files import prepare_folder, write_text
from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.formats.tables import write_table
from bayes_tyre.inference.diagnostics import Diagnostics
from bayes_tyre.record_table import record_extras
from bayes_tyre.report import contrasts, figures, summary
from bayes_tyre.report.figures import Result
from bayes_tyre.report.page import save

LIBRARIES = ("bayes-tyre", "jax", "jaxlib", "numpyro", "optimistix", "equinox", "arviz", "numpy", "pandas", "xarray")


@dataclass(frozen=True)
class Run:
    """How a result is made: the command, its options, the SHA-256 of each input by path, and when it began.

    Make it with `begin_run` before the work: an input may change while a fit runs.
    """

    command: str
    options: Mapping[str, object]
    seed: int
    inputs: Mapping[str, str]
    origin: str
    began: float


def begin_run(command: str, options: Mapping[str, object], seed: int, inputs: list[Path], origin: str) -> Run:
    """Return the run that begins now, its inputs hashed as they are now."""
    hashes = {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in inputs}
    return Run(command, options, seed, hashes, origin, time.monotonic())


def write_fit(
    tree: xr.DataTree,
    diagnostics: Diagnostics,
    run: Run,
    out: Path,
    *,
    table: pd.DataFrame | None = None,
    printed: pd.DataFrame | None = None,
    interval: float = 0.95,
) -> None:
    """Write a posterior with its tables, diagnostics and figures into `out`.

    Parameters
    ----------
    tree, diagnostics, run:
        The posterior, its verdict, and how it came about.
    table:
        The records it was fitted to, for the figures of records.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case, shown beside the posterior where given.
    interval:
        Probability of every interval, equal-tailed.
    """
    prepare_folder(out)
    (out / "run.json").unlink(missing_ok=True)  # an older run's: it must not vouch for half of a newer one
    verdict = diagnostics.verdict
    write_tree(tree, out / "posterior.nc")
    extras = record_extras(table) if table is not None else None
    cases, repeats = summary.cases(tree, verdict, interval), summary.repeats(tree, verdict, interval, extras)
    write_table(summary.summary(tree, verdict, interval), out / "summary.csv")
    write_table(cases, out / "cases.csv")
    write_table(contrasts.contrasts(tree, verdict, interval), out / "contrasts.csv")
    write_table(repeats, out / "repeats.csv")
    write_json(diagnostics._asdict(), out / "diagnostics.json")
    _write_figures(Result(tree, verdict, cases, repeats, table, printed, interval), out / "figures")
    write_run(run, out)


def _write_figures(result: Result, folder: Path) -> None:
    for name, figure in figures.draw(result):
        save(figure, folder / f"{name}.png")


def write_json(content: Mapping[str, object], path: Path) -> None:
    """Write a mapping as JSON; what is not a number becomes null, which every reader takes."""
    clean = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in content.items()}
    write_text(json.dumps(clean, indent=2, ensure_ascii=False, allow_nan=False) + "\n", path)


def write_run(run: Run, out: Path) -> None:
    """Write `run.json`: command, options, seed, origin, versions, SHA-256 of each input, wall time."""
    content = {
        "command": run.command,
        "options": dict(run.options),
        "seed": run.seed,
        "origin": run.origin,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}},
        "inputs": dict(run.inputs),
        "wall_time_s": time.monotonic() - run.began,
    }
    write_json(content, out / "run.json")
