"""Prediction from a result's folder: `prediction.csv` and `prediction.toml`."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import tomli_w
import xarray as xr

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.files import check_folder, whole_file, write_text
from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.table_files import read_table, write_table
from bayes_tyre.inference.sampling.datatree import RECORDS_DIGEST, law_of
from bayes_tyre.plain_text import one_line
from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.report.answer.load import VERDICTS
from bayes_tyre.results.cases.selection import CaseQuery
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.prediction import Prediction, Weighted, predict_stack, predictable_cases
from bayes_tyre.workflow.result_names import COMPARISON, names

NAME = "prediction.csv"
#: Comment at the top of the TOML. Labels come from files and are never put into a comment.
ABOUT = """\
# Parameters of a tyre for a vehicle model, a table [[case]] for each case and direction: kN, mm, kN/mm, km/h.
# step_kN is signed: loading is positive. lower and upper hold the probability `interval`, equal-tailed.
"""
EQUATIONS = {
    "equation_2": "F = F_i + (J + k u) (1 - exp(-|u| / beta)), u = d - d_i; J = k d_i + C - F_i",
    "small_step_limit": "F = F_i + J (1 - exp(-|u| / beta)) + k u, u = d - d_i; J = k d_i + C - F_i",
}


class Result(NamedTuple):
    """A fit on disk: the path of its posterior, the posterior, its cases, and the verdict on it."""

    path: Path
    tree: xr.DataTree
    cases: list[Case]
    verdict: str


def read_result(folder: Path) -> Result:
    """Return the posterior and the verdict in a folder that a fit wrote, and its cases.

    Raises
    ------
    BadInput
        If the folder holds no finished result, one that cannot be read, or one without records.
    """
    path, tree, verdict = read_posterior(folder)
    with errors_name(path):
        return Result(path, tree, predictable_cases(tree), verdict)


def read_posterior(folder: Path) -> tuple[Path, xr.DataTree, str]:
    """Return the path of a posterior, the posterior, and the verdict on it, from a folder that any command wrote.

    Raises
    ------
    BadInput
        If the folder holds no finished result, one that cannot be read, or draws that are not numbers.
    """
    if not (folder / "run.json").is_file():
        raise BadInput(f"{folder}: holds no run.json, so no finished result; name a folder that fit wrote")
    diagnostics = folder / "diagnostics.json"
    try:
        verdict = read_json(diagnostics)["verdict"]
    except (OSError, ValueError, KeyError, TypeError):
        verdict = None
    if verdict not in VERDICTS:
        raise BadInput(f"{diagnostics}: holds no verdict; run fit again")
    path = folder / "posterior.nc"
    tree = read_tree(path)
    if "posterior" not in tree.children:
        raise BadInput(f"{path}: holds no draws; run fit or motion again")
    draws = tree["posterior"]
    if "case" in draws.dims and "case_configuration" not in draws.coords:
        raise BadInput(f"{path}: does not say what its cases are; run fit or motion again")
    for name in (name for name, values in draws.data_vars.items() if values.dtype.kind not in "biuf"):
        raise BadInput(f"{path}: {name} holds no numbers; run fit or motion again")
    return path, tree, verdict


def target(folder: Path, out: Path | None) -> Path:
    """Return the CSV to write: in `out`, which is a folder or itself a `.csv`; by default in the result's folder.

    Raises
    ------
    BadInput
        If it cannot be written there, or has the suffix of another kind of file.
    """
    out = out or folder
    path = out if out.suffix.lower() == ".csv" and not out.is_dir() else out / NAME
    if path.parent == out and out.suffix.lower() in (".parquet", ".toml", ".json"):
        raise BadInput(f"--out {out}: the curves are written as CSV; name a folder or a .csv file")
    check_folder(path.parent)
    if path.is_dir() or path.with_suffix(".toml").is_dir():
        raise BadInput(f"--out {path}: a folder is in the place of a file; name another")
    return path


def answers(curves: pd.DataFrame, most: int = 4) -> list[str]:
    """Return the force (kN) at the last displacement (mm) of each predicted curve, a line each."""
    factors = {name: (texts if name in CASE_FACTORS[:2] else numbers)(curves, name) for name in CASE_FACTORS}
    ends = curves.assign(**factors).groupby(list(CASE_FACTORS), sort=False, dropna=False).tail(1)
    return [
        f"{one_line(Case(*(row[name] for name in CASE_FACTORS)).label)} {one_line(row['direction'])}, "
        f"{row['displacement_mm']:.4g} mm from the start of the step: "
        f"{row['median']:.4g} kN [{row['lower']:.4g}, {row['upper']:.4g}]"
        for row in ends.head(most).to_dict("records")
    ]


class Stack(NamedTuple):
    """Fits of the same records that predict together, by name; and the weight of each."""

    results: dict[str, Result]
    weights: dict[str, float]

    @property
    def verdict(self) -> str:
        """``pass`` where it is that of every fit with a weight."""
        verdicts = [result.verdict for name, result in self.results.items() if self.weights[name] > 0]
        return next((verdict for verdict in verdicts if verdict != "pass"), "pass")

    @property
    def first(self) -> Result:
        """One of the fits: cases and origin are those of all."""
        return next(iter(self.results.values()))


def alone(folder: Path) -> Stack:
    """Return the one fit in a folder.

    Raises
    ------
    BadInput
        As `read_result` does.
    """
    return Stack({folder.name: read_result(folder)}, {folder.name: 1.0})


def read_stack(folders: Sequence[Path], weights: Path) -> Stack:
    """Return fits, each in its folder, and their weights in a table that `compare` wrote of the same folders.

    Parameters
    ----------
    folders:
        Of the fits.
    weights:
        The table, or the folder with ``comparison.csv``.

    Raises
    ------
    BadInput
        If a folder holds no fit, fits are of other records, or the table is not of these.
    """
    path = weights / COMPARISON if weights.is_dir() else weights
    table = read_table(path)
    if not {"model", "weight"} <= set(table.columns):
        raise BadInput(f"{path}: has no columns model and weight; name a table that compare wrote")
    given = dict(zip(texts(table, "model"), numbers(table, "weight"), strict=True))
    by_name = dict(zip(names(folders), folders, strict=True))
    if given.keys() != by_name.keys():
        raise BadInput(
            f"{path}: compares {', '.join(sorted(given))}, the folders are {', '.join(sorted(by_name))}; name the "
            "folders that were compared"
        )
    if not all(np.isfinite(weight) and weight >= 0 for weight in given.values()):
        raise BadInput(f"{path}, column weight: a weight is 0 or more; run compare again")
    results = {name: read_result(folder) for name, folder in by_name.items()}
    digests = {name: result.tree.attrs.get(RECORDS_DIGEST) for name, result in results.items()}
    if len(set(digests.values())) > 1:
        raise BadInput(f"{' and '.join(digests)} are not fits of the same records; stack fits of one table")
    return Stack(results, {name: float(given[name]) for name in by_name})


def write_prediction(
    stack: Stack,
    query: CaseQuery,
    out: Path,
    *,
    displacement_mm: np.ndarray | None = None,
    of: str = "case",
    interval: float = 0.95,
    seed: int = 0,
) -> tuple[Prediction, tuple[Path, ...]]:
    """Predict, and write curves to `out` (`.csv`) and parameters beside it (`.toml`); return what was written.

    Both are written or none; of fits by different laws there are no parameters. Arguments are those of
    `bayes_tyre.results.prediction.predict_stack`.
    """
    models = [Weighted(result.tree, stack.weights[name]) for name, result in stack.results.items()]
    options = {"verdict": stack.verdict, "of": of, "interval": interval, "seed": seed}
    with errors_name(stack.first.path):
        prediction = predict_stack(models, query, displacement_mm, **options)
    beside = out.with_suffix(".toml")
    if not prediction.parameters:
        with whole_file(out) as curves:
            write_table(prediction.curves, curves)
        beside.unlink(missing_ok=True)
        return prediction, (out,)
    tree = stack.first.tree
    head = {"equation": EQUATIONS[law_of(tree)], "of": of, "interval": interval, "origin": tree.attrs["origin"]}
    head |= {"verdict": stack.verdict, "version": f"bayes-tyre {version('bayes-tyre')}"}
    weights = {"weights": stack.weights} if len(models) > 1 else {}
    text = ABOUT + tomli_w.dumps({**head, **weights, "case": list(prediction.parameters)})
    with whole_file(out) as curves, whole_file(beside) as parameters:
        write_table(prediction.curves, curves)
        write_text(text, parameters)
    return prediction, (out, beside)
