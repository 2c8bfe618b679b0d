"""Files for vehicle simulators from a result's folder: each case in files of its own, its certainty in comments."""

import re
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats import simulator
from bayes_tyre.formats.files import prepare_folder, write_text
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.formats.tydex.write import MeasuredChannel, Tydex, tydex_text
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.record import ORIGIN_UNKNOWN
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.results.cases.selection import parse_query, without_opposites
from bayes_tyre.results.prediction import about_untested
from bayes_tyre.results.tyre_model import (
    OF_TEST,
    ONE_WAY,
    Curve,
    Curves,
    TyreModel,
    Value,
    means_of_posterior,
    of_load_deflection,
    of_posterior,
    of_untested,
)
from bayes_tyre.signals.load_deflection import CASE_OF_TEST
from bayes_tyre.workflow.from_results.predict import read_posterior
from bayes_tyre.workflow.load_deflection import CASES, TESTS

_NEEDED = ("test", *CASE_OF_TEST, "status", "origin", "k_kN_per_mm", "flat_ground_low_mm")
_HEADER = {"FILE_TYPE": "tir", "FILE_VERSION": 3.0, "FILE_FORMAT": "ASCII"}
_UNITS = {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radian", "MASS": "kg", "TIME": "second"}
_FLAT_GROUND = "k, beta and forces are as on flat ground"
_AT_WHEEL_CENTRE = ("c", "energy_per_cycle")
_AS_TESTED = "all of them are of the configuration as tested: of dual tyres, of both together"
_NOT_KNOWN = {
    "UNLOADED_RADIUS": "no result holds it; --unloaded-radius-mm states it",
    "VERTICAL_DAMPING": "only a result of motion holds it",
    "DEFLECTION_LOAD_CURVE": "only load-deflection tests have deflection since first touch",
    "FNOMIN, BREFF, DREFF, FREFF, all coefficients of a tyre model": "no result holds them",
}


class Exported(NamedTuple):
    """The cases of a result, the origin of their data, and the verdict; empty for load-deflection, which has none.

    `notes` are sentences on cases that were not tested.
    """

    models: list[TyreModel]
    origin: str
    verdict: str
    notes: Sequence[str] = ()


def read_models(folder: Path, level: float = 0.5, cases: Sequence[str] = (), *, means: bool = False) -> Exported:
    """Return the cases of a result of `fit`, `motion` or `load-deflection`, at a quantile of the posterior.

    `cases` are labels or factors of those wanted (`bayes_tyre.results.cases.selection.parse_query`), of `fit` also of
    speeds, loads and steps that were not tested; none: all. `means`
    are those over the cases of each configuration and direction instead.

    Raises
    ------
    BadInput
        If the folder holds no such result, or estimates alone where another quantile than the median, some of the cases
        or means are asked for; or if no case matches.
    """
    if (folder / "posterior.nc").exists() or not (folder / TESTS).is_file():
        path, tree, verdict = read_posterior(folder)
        with errors_name(path):
            models = means_of_posterior(tree, level) if means else of_posterior(tree, level)
            notes = []
            if cases:
                all_cases = tree_cases(tree["posterior"].to_dataset())
                selected = without_opposites(parse_query(cases, all_cases), all_cases)
                models = [models[i] for i in selected.cases] + of_untested(tree, selected.untested, level)
                notes = about_untested(selected.untested, all_cases)
            return Exported(models, str(tree.attrs.get("origin", ORIGIN_UNKNOWN)), verdict, notes)
    for given, option in ((level != 0.5, "--quantiles"), (cases, "--case"), (means, "--means")):
        if given:
            raise BadInput(f"{folder}: holds estimates and no posterior; leave {option} out")
    rows = read_table(folder / TESTS)
    if missing := [column for column in _NEEDED if column not in rows]:
        raise BadInput(f"{folder / TESTS}: lacks column {missing[0]}; run load-deflection again")
    if (folder / CASES).is_file():  # a test that was averaged is not exported by itself
        averaged = read_table(folder / CASES)
        factors = [name for name in CASE_OF_TEST if name in averaged]
        of_a_case = pd.MultiIndex.from_frame(rows[factors]).isin(pd.MultiIndex.from_frame(averaged[factors]))
        rows = pd.concat([averaged, rows[~of_a_case]], ignore_index=True)
    numbers = rows.columns.drop(["test", "configuration", "status", "origin"])
    rows[numbers] = rows[numbers].apply(pd.to_numeric, errors="coerce")
    models = of_load_deflection(rows)
    if not models:
        raise BadInput(f"{folder / TESTS}: holds no k above zero; its column status says why")
    if len(models) < len(rows):
        warnings.warn(f"{len(rows) - len(models)} tests without a k above zero are left out", stacklevel=2)
    return Exported(models, " + ".join(sorted(set(rows["origin"]))), "")


def write_export(
    folder: Path,
    to: str,
    out: Path,
    *,
    quantiles: Sequence[float] = (),
    radius_mm: float | None = None,
    cases: Sequence[str] = (),
    means: bool = False,
) -> tuple[Exported, list[Path]]:
    """Write the files of every case into `out`; return what was exported at the median, and the paths.

    `to` is a name of `TARGETS`; `cases` and `means` are as `read_models` has them. Each quantile gives every case
    further files, whose names end with it. `radius_mm` is the tyre's unloaded radius, mm, where it is known.

    Raises
    ------
    BadInput
        If the result cannot be read, or the format needs a curve and the result has none.
    """
    by_level = {level: read_models(folder, level, cases, means=means) for level in (0.5, *quantiles)}
    texts: dict[str, str] = {}
    for level, exported in by_level.items():
        ending = "" if level == 0.5 else "_q" + re.sub(r"\W", "_", f"{level:g}")
        for name, model in zip(_names([model.label for model in exported.models]), exported.models, strict=True):
            with errors_name(folder):
                texts |= TARGETS[to](model, name + ending, _about(model, exported, level), radius_mm)
    prepare_folder(out)
    return by_level[0.5], [write_text(text, out / name) for name, text in texts.items()]


def _names(labels: Sequence[str]) -> list[str]:
    """Return a name for each label that serves as a file's and as an identifier; none twice in any letter case."""
    names: list[str] = []
    for label in labels:
        signed = re.sub(r"(?<![A-Za-z0-9)])-(?=\d)", "minus_", label)
        name = re.sub(r"[^A-Za-z0-9]+", "_", signed).strip("_")[:60]
        name = name if name[:1].isalpha() else f"case_{name}"
        while name.lower() in [other.lower() for other in names]:
            name += "_"
        names.append(name)
    return names


def _about(model: TyreModel, exported: Exported, level: float) -> list[str]:
    """Return what every file says: what was exported, from what data, how certain it is."""
    of_draws = "median of the posterior" if level == 0.5 else f"quantile {level:g} of the posterior, each by itself"
    values = of_draws if exported.verdict else "least-squares estimates"
    verdict = f"; verdict: {exported.verdict}" if exported.verdict else ""
    lines = [f"bayes-tyre {version('bayes-tyre')}: fitted, not a measurement", f"case: {model.label}"]
    lines += [f"tested: {model.conditions}; loads are the cylinder's"] if model.conditions else []
    lines += [f"data: {exported.origin}; values: {values}{verdict}", *([model.status] if model.status else [])]
    if exported.verdict == "fail":
        lines.append("NOT TO BE TRUSTED: verdict fail; diagnostics.json of the result gives the reasons")
    lines += [
        f"{in_words(name)} = {one.value:.6g} {one.unit}, {_interval(one)}" for name, one in model.parameters.items()
    ]
    elsewhere = [name for name in _AT_WHEEL_CENTRE if name in model.parameters]
    place = f"{_FLAT_GROUND}, {' and '.join(elsewhere)} at the wheel centre" if elsewhere else _FLAT_GROUND
    return [*lines, f"{place}; {_AS_TESTED}"]


def _interval(one: Value) -> str:
    has_interval = one.lower == one.lower
    return f"95 % interval {one.lower:.6g} to {one.upper:.6g}" if has_interval else "interval not known"


def _tir(model: TyreModel, name: str, about: list[str], radius_mm: float | None) -> dict[str, str]:
    radius = {} if radius_mm is None else {"UNLOADED_RADIUS": radius_mm / 1e3}
    keys = {"VERTICAL_STIFFNESS": "k", "VERTICAL_DAMPING": "c"}
    vertical = {key: model.parameters[of].value for key, of in keys.items() if of in model.parameters}
    curves = {}
    if model.curves is not None and model.curves.about == OF_TEST:
        curves = {"DEFLECTION_LOAD_CURVE": ("pen fz", _rows(model.curves.spline))}
        about = [*about, model.curves.about, model.curves.lost]
    lost = ["hysteresis is lost: a tyre property file has no field for it"]
    lost += [
        "no tyre model by itself: put the sections below into the file of yours, whose [MODEL] names its kind",
        "numbers are in the units below: convert them where your file has others (N/m are N/mm times 1000)",
    ]
    unknown = [f"left out: {key}: {why}" for key, why in not_in_tir(model, radius_mm).items()]
    sections = {"MDI_HEADER": _HEADER, "UNITS": _UNITS, "MODEL": {}, "DIMENSION": radius, "VERTICAL": vertical}
    return {f"{name}.tir": simulator.property_file(sections, [*about, *lost, *unknown], curves)}


def not_in_tir(model: TyreModel, radius_mm: float | None) -> dict[str, str]:
    """Return what a tyre property file could hold and the result does not, each with the reason."""
    has_value = {
        "UNLOADED_RADIUS": radius_mm is not None,
        "VERTICAL_DAMPING": "c" in model.parameters,
        "DEFLECTION_LOAD_CURVE": model.curves is not None and model.curves.about == OF_TEST,
    }
    return {key: why for key, why in _NOT_KNOWN.items() if not has_value.get(key)}


def _tydex(model: TyreModel, name: str, about: list[str], _radius: float | None) -> dict[str, str]:
    path, _, meaning, lost = _curves(model)
    channels = [
        MeasuredChannel("TYREDEFW", "Fitted tyre deflection", "m", path.deflection),
        MeasuredChannel("FZW", "Fitted vertical force", "N", path.force),
    ]
    header = {"MEASID": model.label, "SUPPLIER": "bayes-tyre: fitted curve, not a measurement"}
    about = [*about, meaning, *([lost] if lost == ONE_WAY else []), _width(path)]
    return {f"{name}.tdx": tydex_text(Tydex(header, channels, comments=about))}


def _modelica(model: TyreModel, name: str, about: list[str], _radius: float | None) -> dict[str, str]:
    parameters = {key: (one.value, one.unit, _interval(one)) for key, one in model.parameters.items()}
    if model.curves is None:
        about = [*about, "no table of the force: the result has no curve"]
        return {f"{name}.mo": simulator.modelica_record(name, parameters, about)}
    _, spline, meaning, lost = model.curves
    about = [*about, meaning, lost, _width(spline)]
    about += [f"table force(deflection m, force N) for CombiTable1D: {name}.txt"]
    table = simulator.combi_table("force", _rows(spline), about)
    return {f"{name}.mo": simulator.modelica_record(name, parameters, about), f"{name}.txt": table}


def _spline(model: TyreModel, name: str, about: list[str], _radius: float | None) -> dict[str, str]:
    _, spline, meaning, lost = _curves(model)
    rows = [(1e3 * deflection, force) for deflection, force in _rows(spline)]
    about = [*about, meaning, lost, _width(spline), "columns: deflection mm, force N"]
    return {f"{name}.csv": simulator.spline_file(rows, about)}


def _curves(model: TyreModel) -> Curves:
    if model.curves is None:
        only = "only records, load-deflection tests and motions on Fancher's law have one"
        raise BadInput(f"holds no force curve, which this format needs: {only}; use --to tir")
    return model.curves


def _rows(curve: Curve) -> list[tuple[float, float]]:
    return list(zip(curve.deflection.tolist(), curve.force.tolist(), strict=True))


def _width(curve: Curve) -> str:
    above, below = (curve.upper - curve.force).max(), (curve.force - curve.lower).max()
    if above != above:
        return "interval of the force: not known from estimates alone"
    return f"95 % interval of the force: at most {above:.4g} N above and {below:.4g} N below the curve"


#: What makes the files of a case, text by name, by the name of the format.
TARGETS: dict[str, Callable[[TyreModel, str, list[str], float | None], dict[str, str]]] = {
    "tir": _tir,
    "tydex": _tydex,
    "modelica": _modelica,
    "csv-spline": _spline,
}
