"""Prediction from a result's folder: `prediction.csv` and `prediction.toml`."""

from collections.abc import Mapping, Sequence
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
from bayes_tyre.inference.sampling.common_scales import POWERS
from bayes_tyre.inference.sampling.datatree import RECORDS_DIGEST, law_of
from bayes_tyre.plain_text import one_line
from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.report.answer.load import VERDICTS
from bayes_tyre.results.cases.selection import CaseQuery
from bayes_tyre.results.cases.stacked import Weighted
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.prediction import Prediction, predict_stack, predictable_cases
from bayes_tyre.workflow.result_names import COMPARISON, names

NAME, DIAGNOSTICS_JSON = "prediction.csv", "diagnostics.json"
#: Comment at the top of the TOML. Labels come from files and are never put into a comment.
ABOUT = """\
# Parameters of a tyre for a vehicle model, a table [[case]] for each case and direction: kN, mm, kN/mm, km/h.
# step_kN is signed: loading is positive. lower and upper hold the probability `interval`, equal-tailed.
"""
EQUATIONS = {
    "equation_2": "F = F_i + (J + k u) (1 - exp(-|u| / beta)), u = d - d_i; J = k d_i + C - F_i",
    "small_step_limit": "F = F_i + J (1 - exp(-|u| / beta)) + k u, u = d - d_i; J = k d_i + C - F_i",
}


class StoredFit(NamedTuple):
    """A fit on disk: the path of its posterior, the posterior, its cases, and the verdict on it."""

    path: Path
    tree: xr.DataTree
    cases: list[Case]
    verdict: str


def read_result(folder: Path) -> StoredFit:
    """Return the posterior and the verdict in a folder that a fit wrote, and its cases.

    Raises
    ------
    BadInput
        If the folder holds no finished result, one that cannot be read, or one without records.
    """
    path, tree, verdict = read_posterior(folder)
    with errors_name(path):
        return StoredFit(path, tree, predictable_cases(tree), verdict)


def read_posterior(folder: Path) -> tuple[Path, xr.DataTree, str]:
    """Return the path of a posterior, the posterior, and the verdict on it, from a folder that any command wrote.

    Raises
    ------
    BadInput
        If the folder holds no finished result, one that cannot be read, or draws that are not numbers.
    """
    if not (folder / "run.json").is_file():
        raise BadInput(f"{folder}: holds no run.json, so no finished result; name a folder that fit wrote")
    diagnostics = folder / DIAGNOSTICS_JSON
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
    """Return the force (kN) at the far end (mm) of each predicted curve, a line each, and how many more there are."""
    factors = {name: (texts if name in CASE_FACTORS[:2] else numbers)(curves, name) for name in CASE_FACTORS}
    outward = curves.assign(**factors).sort_values("displacement_mm", key=abs, kind="stable")
    ends = outward.groupby(list(CASE_FACTORS), sort=False, dropna=False).tail(1).sort_index()
    lines = [
        f"{_curve(Case(*(row[name] for name in CASE_FACTORS)))}, {row['displacement_mm']:.4g} mm from the start of the "
        f"step: {row['median']:.4g} kN [{row['lower']:.4g}, {row['upper']:.4g}]"
        for row in ends.head(most).to_dict("records")
    ]
    more = len(ends) - most
    return [*lines, f"{more} more curve{'s' * (more > 1)}"] if more > 0 else lines


def _curve(case: Case) -> str:
    """Return a case's label and its direction, which the label names by itself where there is no step."""
    direction = "" if np.isnan(case.step_kN) else case.direction
    return one_line(" ".join(part for part in (case.label, direction) if part), 100)


class Stack(NamedTuple):
    """Fits of the same records that predict together.

    Attributes
    ----------
    results, weights:
        By name.
    failed:
        What says that a fit, or the comparison that the weights are from, is not to be trusted: its files.
    """

    results: dict[str, StoredFit]
    weights: dict[str, float]
    failed: tuple[Path, ...] = ()

    @property
    def verdict(self) -> str:
        """``pass``, or where anything failed ``fail``."""
        return "fail" if self.failed else "pass"

    @property
    def first(self) -> StoredFit:
        """The first fit that has a weight: cases and origin are those of all."""
        return next(result for name, result in self.results.items() if self.weights[name] > 0)


def single_fit(folder: Path) -> Stack:
    """Return the fit in a folder as a stack of one.

    Raises
    ------
    BadInput
        As `read_result` does.
    """
    result = read_result(folder)
    failed = () if result.verdict == "pass" else (folder / DIAGNOSTICS_JSON,)
    return Stack({folder.name: result}, {folder.name: 1.0}, failed)


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
        If a folder holds no fit, the table is not of these, or fits are not of the same records with the same factors.
    """
    path = weights / COMPARISON if weights.is_dir() else weights
    table = read_table(path)
    if not {"model", "weight", "verdict"} <= set(table.columns):
        raise BadInput(f"{path}: lacks one of the columns model, weight, verdict; name a table that compare wrote")
    given = dict(zip(texts(table, "model"), numbers(table, "weight").to_numpy(float), strict=True))
    by_name = _folders_of(list(given), folders, path)
    if not (all(0 <= weight < np.inf for weight in given.values()) and sum(given.values()) > 0):
        raise BadInput(f"{path}, column weight: weights are 0 or more, and not all of them 0; run compare again")
    results = {name: read_result(folder) for name, folder in by_name.items()}
    _check_alike(results)
    failed = [by_name[name] / DIAGNOSTICS_JSON for name in given if given[name] > 0 and results[name].verdict != "pass"]
    # The weights rest on what every model predicts of records left out.
    compared = set(texts(table, "verdict")) == {"pass"}
    return Stack(results, {name: float(given[name]) for name in results}, (*failed, *([] if compared else [path])))


def _folders_of(models: Sequence[str], folders: Sequence[Path], path: Path) -> dict[str, Path]:
    """Return the folder of each model of a comparison, whose name is the end of its path."""
    ends = {folder: f"/{folder.resolve().as_posix()}" for folder in folders}
    folders_of = {model: [folder for folder, end in ends.items() if end.endswith(f"/{model}")] for model in models}
    used = [each[0] for each in folders_of.values() if len(each) == 1]
    if len(used) < len(models) or set(used) != set(folders):
        raise BadInput(
            f"{path}: compares {', '.join(sorted(models))}, the folders are {', '.join(sorted(names(folders)))}; name "
            "the folders that were compared"
        )
    return {model: each[0] for model, each in folders_of.items()}


def _check_alike(results: Mapping[str, StoredFit]) -> None:
    digests = {result.tree.attrs.get(RECORDS_DIGEST) for result in results.values()}
    if len(digests) > 1:
        raise BadInput(f"{' and '.join(results)} are not fits of the same records; stack fits of one table")
    for scale in POWERS:  # records cannot tell of one, so that neither can weights
        if len({scale in result.tree["posterior"] for result in results.values()}) > 1:
            raise BadInput(
                f"some of {' and '.join(results)} have an unknown {scale}, others have none; fit all with one "
                f"--{scale.replace('_', '-')}-sd"
            )


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
    with errors_name(" and ".join(str(result.path) for result in stack.results.values())):
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
