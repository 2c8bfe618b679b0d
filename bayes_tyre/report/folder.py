"""A result's folder: every file that a fit writes, each whole or not at all, `run.json` last."""

import hashlib
import json
import math
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables import whole_file, write_table, write_text
from bayes_tyre.inference.diagnostics import Diagnostics
from bayes_tyre.inference.posterior import RECORD_UNITS
from bayes_tyre.report import contrasts, figures, predictive, summary

LIBRARIES = ("bayes-tyre", "jax", "jaxlib", "numpyro", "optimistix", "equinox", "arviz", "numpy", "pandas", "xarray")


#: What the cases' intervals are of, where a reader of the figure could take them for something else, by model.
ABOUT_CASES = {"published": "They are of the value to expect; single printed values scatter about it."}


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


def check_folder(out: Path) -> None:
    """Refuse a folder that cannot be made, before minutes of work and without making it.

    Raises
    ------
    BadInput
        If it is a file, lies below one, or lies where one may not write.
    """
    if any(path.exists() and not path.is_dir() for path in (out, *out.parents)):
        raise BadInput(f"--out {out}: is a file, or lies below one; name a folder")
    there = next(path for path in (out.absolute(), *out.absolute().parents) if path.exists())
    if not os.access(there, os.W_OK | os.X_OK):
        raise BadInput(f"--out {out}: {there} may not be written to; name a folder that you may write to")


def prepare_folder(out: Path) -> None:
    """Make the folder that results go into.

    Raises
    ------
    BadInput
        If it is a file or cannot be made.
    """
    check_folder(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {out}: {error.strerror}; name a folder that you may write to") from None


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
        The records it was fitted to, for the figure that shows some of them.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case, shown beside the posterior where given.
    interval:
        Probability of every interval, equal-tailed.
    """
    prepare_folder(out)
    (out / "run.json").unlink(missing_ok=True)  # an older run's: it must not vouch for half of a newer one
    verdict = diagnostics.verdict
    with whole_file(out / "posterior.nc") as beside:
        tree.to_netcdf(beside, engine="h5netcdf")
    cases, repeats = summary.cases(tree, verdict, interval), summary.repeats(tree, verdict, interval)
    write_table(summary.summary(tree, verdict, interval), out / "summary.csv")
    write_table(cases, out / "cases.csv")
    write_table(contrasts.contrasts(tree, verdict, interval), out / "contrasts.csv")
    write_table(repeats, out / "repeats.csv")
    write_json(diagnostics._asdict(), out / "diagnostics.json")
    _write_figures(tree, cases, repeats, table, printed, interval, out / "figures")
    write_run(run, out)


def _write_figures(
    tree: xr.DataTree,
    cases: pd.DataFrame,
    repeats: pd.DataFrame,
    table: pd.DataFrame | None,
    printed: pd.DataFrame | None,
    interval: float,
    folder: Path,
) -> None:
    origin = tree.attrs["origin"]
    drawn = {
        "posteriors_by_direction": figures.posteriors_by_direction(_cell_draws(tree), origin, interval),
        "forest_of_cases": figures.forest_of_cases(cases, printed, origin, ABOUT_CASES.get(tree.attrs["model"], "")),
    }
    if table is not None:
        shown = predictive.records_to_show(tree)
        bands = predictive.predictive_bands(tree, table, shown, interval)
        points = table.loc[table["record"].isin(shown), ["record", "displacement_mm", "force_kN"]]
        drawn["records_with_bands"] = figures.records_with_bands(points, bands, origin, interval)
        one_row_each = repeats.drop_duplicates("record")
        drawn["outlier_probabilities"] = figures.outlier_probabilities(one_row_each, origin)
    for name, figure in drawn.items():
        figures.save(figure, folder / f"{name}.png")


def _cell_draws(tree: xr.DataTree) -> pd.DataFrame:
    """Return the draws of the cell means in long form: configuration, direction, parameter, unit, value."""
    means = summary.cell_means(tree)
    long = means.stack(sample=("chain", "draw", "cell")).reset_index("sample", drop=True)
    words = {word: long[word].to_numpy() for word in ("configuration", "direction")}
    blocks = [
        pd.DataFrame({**words, "parameter": name, "unit": RECORD_UNITS[str(name)], "value": draws.to_numpy()})
        for name, draws in long.data_vars.items()
    ]
    return pd.concat(blocks, ignore_index=True)


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
