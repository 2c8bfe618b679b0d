"""A result as a vehicle simulator needs it: parameters and a force curve of each case, in SI units."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.load_deflection.table import law_loop
from bayes_tyre.inference.sampling.datatree import is_of_motions, law_of, priors_of, tree_cases
from bayes_tyre.inference.sampling.group_means import named_group_means
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import CASE_FACTORS, RECORD_UNITS, Case, parameter_column
from bayes_tyre.results.cases.draws import CaseValues, parameters_of_case, tested, travel_mm
from bayes_tyre.results.cases.selection import sign_of
from bayes_tyre.results.cases.untested import untested, untested_rng
from bayes_tyre.results.figure_data import hysteresis_loops
from bayes_tyre.results.prediction import force_kN

_TAILS, _NORMAL = (0.025, 0.975), 1.959964
_SI = {
    **{"kN/mm": (1e6, "N/m"), "mm": (1e-3, "m"), "kN": (1e3, "N"), "kN s/mm": (1e6, "N.s/m")},
    **{unit: (1.0, unit) for unit in ("kg", "J", "Hz", "1")},
}
#: Columns of slow tests by parameter; points of the curve of a step, and of a straight line.
_OF_TEST = {name: parameter_column(name) for name in ("k", "C", "x", "beta")} | {"settled": "x_less_k_beta_kN"}
_POINTS, _LINE = 101, 21
OF_STEP = (
    "curve of one step: deflection counts from the start of the step (loading positive), force is the whole load; "
    "C is the envelope's force where the records' displacement is 0, not where this curve starts"
)
OF_CYCLE = "curve of a cycle: deflection and force count from its middle"
OF_TEST = "curve of a slow test: deflection counts from first touch"
ONE_WAY = "hysteresis is lost: this is the path of one step, and the way back is another path"
MIDDLE = "hysteresis is lost: this is the middle line, loading lies {0:.0f} N above and unloading {0:.0f} N below it"


class Value(NamedTuple):
    """A parameter with its 95 % interval, NaN where not known, in an SI unit."""

    value: float
    lower: float
    upper: float
    unit: str


class Curve(NamedTuple):
    """Force (N) over deflection (m), shape (points,), with the 95 % interval of the force, NaN where not finite."""

    deflection: Float[np.ndarray, " points"]
    force: Float[np.ndarray, " points"]
    lower: Float[np.ndarray, " points"]
    upper: Float[np.ndarray, " points"]


class Curves(NamedTuple):
    """The curve as it is passed through; with one force for each deflection, which grows; and a sentence on either.

    `about` says from where deflection and force count, `lost` what `spline` does not hold.
    """

    path: Curve
    spline: Curve
    about: str
    lost: str


class TyreModel(NamedTuple):
    """A case, or a slow test: its label, its parameters by name, its curves if it has any.

    A slow test has a status, a case its conditions in words.
    """

    label: str
    parameters: Mapping[str, Value]
    curves: Curves | None = None
    status: str = ""
    conditions: str = ""


def of_posterior(tree: xr.DataTree, level: float = 0.5) -> list[TyreModel]:
    """Return the cases of a posterior; those of records, and of motions on Fancher's law, have curves.

    `level` is the quantile of each parameter, and of the force at each deflection; 0.5 is the median.

    Raises
    ------
    BadInput
        If it is no posterior of cases.
    """
    posterior = _posterior_of_cases(tree)
    of_motions, models, together = is_of_motions(posterior), [], with_records(tree)
    for i, case in enumerate(tree_cases(posterior)):
        draws = parameters_of_case(posterior, i)
        if "record" in posterior.dims and not of_motions:
            models.append(_of_step(tested(together, i), together, law_of(tree), level, draws))
            continue
        follows = of_motions and tree.attrs.get("law", hysteresis_loops.LAW) == hysteresis_loops.LAW
        curves = _cycle(draws, _amplitude_mm(tree), level) if follows else None
        models.append(TyreModel(case.label, _values(draws, level), curves, conditions=case.conditions))
    return models


def of_untested(tree: xr.DataTree, cases: Sequence[Case], level: float = 0.5) -> list[TyreModel]:
    """Return cases without records, as `bayes_tyre.results.prediction` has them; others as in `of_posterior`.

    Raises
    ------
    BadInput
        If it is no posterior of records.
    """
    posterior, priors, models = _posterior_of_cases(tree), priors_of(tree), []
    if cases and ("record" not in posterior.dims or is_of_motions(posterior)):
        raise BadInput("has cases of records that were not tested only where fit wrote it from records")
    together = with_records(tree)
    for case in cases:
        model = _of_step(untested(together, priors, case, untested_rng(posterior)), together, law_of(tree), level)
        models.append(model._replace(conditions=f"none; predicted from other tests for {case.conditions}"))
    return models


def _posterior_of_cases(tree: xr.DataTree) -> xr.Dataset:
    posterior = tree["posterior"].to_dataset() if "posterior" in tree.children else xr.Dataset()
    if not {"k_case", *(f"case_{factor}" for factor in CASE_FACTORS)} <= set(posterior.variables):
        raise BadInput("is no posterior of cases; name a folder that fit or motion wrote")
    return posterior


def _of_step(
    case: CaseValues,
    posterior: xr.Dataset,
    law: str,
    level: float,
    draws_of_case: Mapping[str, Float[np.ndarray, " all"]] | None = None,
) -> TyreModel:
    """Return a case of records, with the curve of its step as far as its records go.

    `draws_of_case` has parameters of which there are more draws than of its records.
    """
    step, sign = case.mean(), sign_of(case.case) or 1
    draws = {"k": step.k, "beta": step.beta, "J": step.J, "C": step.C, "F_i": step.F_i}
    u = travel_mm(posterior, case.case) * np.linspace(0.0, 1.0, _POINTS) ** 2  # dense where the force changes fast
    force = force_kN(sign * u, *(draws[name][:, None] for name in ("F_i", "J", "k", "beta")), law=law)
    path = _curve(sign * u + 0.0, force, level)
    curves = Curves(path, Curve(*(column[::sign] for column in path)), OF_STEP, ONE_WAY)
    return TyreModel(
        case.case.label, _values({**draws, **(draws_of_case or {})}, level), curves, "", case.case.conditions
    )


def means_of_posterior(tree: xr.DataTree, level: float = 0.5) -> list[TyreModel]:
    """Return the means over the cases of each configuration and direction, as `summary.csv` has them: no curves."""
    means, cases = named_group_means(tree), tree_cases(tree["posterior"].to_dataset())
    models = []
    for i, label in enumerate(means["mean_of"].to_numpy()):
        values = {
            str(name).removesuffix("_mean"): _value(
                draws.isel(mean_of=i).to_numpy().ravel(), RECORD_UNITS[str(name).removesuffix("_mean")], level
            )
            for name, draws in means.data_vars.items()
        }
        group = tuple(means[name].to_numpy()[i] for name in CASE_FACTORS[:2])
        count = sum((case.configuration, case.direction) == group for case in cases)
        about = f"mean over {count} cases of {label or 'all records'}"
        models.append(TyreModel(f"{label} mean".strip(), values, conditions=about))
    return models


def _amplitude_mm(tree: xr.DataTree) -> float:
    try:
        amplitude = float(tree.attrs["amplitude_mm"])
    except (KeyError, TypeError, ValueError):
        amplitude = np.nan
    if not 0 < amplitude < np.inf:
        raise BadInput("does not say the amplitude of its cycles; run motion again")
    return amplitude


def _cycle(draws: Mapping[str, np.ndarray], amplitude_mm: float, level: float) -> Curves:
    k, x, beta = (draws[name] for name in ("k", "x", "beta"))
    friction = hysteresis_loops.settled_friction(k, x, beta, amplitude_mm)
    d = hysteresis_loops.loop_table(amplitude_mm, friction[0])["displacement_mm"].to_numpy()
    line = np.linspace(-amplitude_mm, amplitude_mm, _LINE)
    path, middle = (_curve(at, of + k[:, None] * at, level) for at, of in ((d, friction), (line, 0.0)))
    return Curves(path, middle, OF_CYCLE, MIDDLE.format(1e3 * np.median(x - k * beta)))


def of_load_deflection(rows: pd.DataFrame) -> list[TyreModel]:
    """Return the slow tests of `load_deflection.csv` or `load_deflection_cases.csv` whose k is known and positive.

    Intervals are those of a normal distribution with the standard errors; curves have none.
    """
    return [_slow_test(row) for row in rows.to_dict("records") if row[_OF_TEST["k"]] > 0]


def _slow_test(row: dict[Any, Any]) -> TyreModel:
    values = {}
    for name, column in _OF_TEST.items():
        (factor, unit), half = _SI[RECORD_UNITS[name]], _NORMAL * row[f"{column}_se"]
        if np.isfinite(row[column]):
            values[name] = Value(*(factor * (row[column] + off) for off in (0.0, -half, half)), unit=unit)
    low, high = row["flat_ground_low_mm"], row["flat_ground_high_mm"]
    line = np.linspace(low, high, _LINE)
    middle = np.stack([line, row[_OF_TEST["k"]] * line + row[_OF_TEST["C"]]], axis=1)
    middle = np.concatenate([np.zeros((1, 2)), middle[(middle > 0).all(axis=1)]])
    path, spline = (
        Curve(1e-3 * d, 1e3 * F, *np.full((2, len(d)), np.nan)) for d, F in (law_loop(row, low, high).T, middle.T)
    )
    lost = MIDDLE.format(1e3 * row[_OF_TEST["settled"]]) + "; it is straight from 0 0 to the first reading"
    return TyreModel(str(row["test"]), values, Curves(path, spline, OF_TEST, lost), f"status: {row['status']}")


def _values(draws: Mapping[str, np.ndarray], level: float) -> dict[str, Value]:
    """Return the parameters that are known: C is not where it is not known where a step starts."""
    finite = {name: each for name, each in draws.items() if np.isfinite(each).all()}
    return {name: _value(each, RECORD_UNITS[name], level) for name, each in finite.items()}


def _value(draws: np.ndarray, unit: str, level: float) -> Value:
    factor, si = _SI[unit]
    return Value(*(float(each) for each in factor * np.quantile(draws, [level, *_TAILS])), unit=si)


def _curve(deflection_mm: np.ndarray, draws_kN: np.ndarray, level: float) -> Curve:
    return Curve(1e-3 * deflection_mm, *(1e3 * np.quantile(draws_kN, [level, *_TAILS], axis=0)))
