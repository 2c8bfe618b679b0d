"""Force against displacement for a vehicle model, from the posterior of records: curves with intervals, parameters.

The law that the records were fitted with, in u, the displacement from the start of the step: Equation 2 is
``F = F_i + (J + k u)(1 - exp(-|u| / beta))``, its limit for small steps ``F = F_i + J (1 - exp(-|u| / beta)) + k u``.
A posterior may hold `displacement_scale`, an unknown common factor on the displacement that was measured: its k and
beta then hold for true displacement, and so does what is predicted here.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.record_data import EQUATION_2, LAWS
from bayes_tyre.inference.sampling.datatree import law_of, tree_cases
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.results.cases.draws import draw_noise, joined, travel_mm
from bayes_tyre.results.cases.selection import CaseQuery, case_list, choose, sign_of, without_opposite
from bayes_tyre.results.cases.stacked import DrawnCase, Weighted, drawn_cases, shares_of
from bayes_tyre.results.equal_tailed import median_lower_upper

#: The mean curve of a case, or a repeat of it that was not measured.
KINDS = ("case", "repeat")
#: Factors that are numbers, in words, and their units.
_NUMBERS = {"speed_km_h": ("speed", "km/h"), "initial_load_kN": ("initial load", "kN"), "step_kN": ("step", "kN")}
DEFAULT_POINTS = 101
#: Most points times draws that are computed at once.
CELLS = 2_000_000
COLUMNS = (
    *CASE_FACTORS,
    *("displacement_mm", "parameter", "unit", "median", "lower", "upper", "interval", "of", "origin", "verdict"),
)
_changes_of_force = {name: jax.jit(law) for name, law in LAWS.items()}
_NEEDED = {"k_case": "case", "beta_case": "case", "k": "record", "J": "record", "C": "record", "F_i": "record"}


class Prediction(NamedTuple):
    """What is predicted.

    Attributes
    ----------
    curves:
        `COLUMNS`: force (kN) against displacement from the start of the step (mm; positive in loading, negative in
        unloading), a row a point. `of` says of a case without records that it is untested.
    parameters:
        A mapping a case and direction: `label`, the factors given, and `k_kN_per_mm`, `beta_mm`, `J_kN`, `C_kN`,
        `F_i_kN`, `d_i_mm`, each with `mean`, `sd`, `lower`, `upper`; of a case without records `tested`, false, and
        neither C nor d_i.
    warnings:
        What was asked for and is not there, a sentence each.
    """

    curves: pd.DataFrame
    parameters: tuple[dict[str, object], ...]
    warnings: tuple[str, ...]


def predict_stack(
    models: Sequence[Weighted],
    query: CaseQuery,
    displacement_mm: Float[np.ndarray, " points"] | None = None,
    *,
    verdict: str,
    of: str = "case",
    interval: float = 0.95,
    seed: int = 0,
) -> Prediction:
    """Return what several models predict together, the draws of each in proportion to its weight.

    Parameters
    ----------
    models:
        Posteriors of the same records, and their weights.
    query:
        The cases asked for, as `bayes_tyre.results.cases.selection.parse_query` gives them. A speed, load or step for
        which there is no case is predicted by `bayes_tyre.results.cases.untested`.
    displacement_mm:
        From the start of the step. Without a negative number they are magnitudes and serve both directions;
        otherwise loading takes those from 0 up, unloading those from 0 down. A case that does not say its direction
        takes them as they are. By default 101 points from 0 to as far as the case's records go.
    verdict:
        Of the posteriors, put into each row.
    of:
        ``case``: the mean curve of the case; ``repeat``: one more repeat of it, with the noise of each point.
        `bayes_tyre.results.cases.draws` says what either takes from the posterior.
    interval:
        Probability between `lower` and `upper`, at each displacement by itself; equal-tailed.
    seed:
        Of what a repeat adds, and of cases that were not tested; the numbers of a case do not depend on what other
        cases are asked for.

    Raises
    ------
    BadInput
        For a posterior without records, no case that matches, displacements that no chosen case can use, models of
        other records, and weights that are all 0.

    Source: Yao, Vehtari, Simpson & Gelman (2018), "Using stacking to average Bayesian predictive distributions".
    """
    if of not in KINDS:
        raise BadInput(f"of is {of!r}; use {' or '.join(KINDS)}")
    cases, *others = (predictable_cases(model.tree) for model in models)
    if any(other != cases for other in others):
        raise BadInput("models of other records have other cases; stack models of the same records")
    choice, shares = choose(query, cases), shares_of(models)
    posterior, laws = with_records(models[0].tree), {law_of(share.tree) for share in shares}
    warnings = [f"no opposite direction of {case_list([cases[i].label for i in choice.alone])}"] if choice.alone else []
    warnings += about_untested(choice.untested, cases)
    if len(laws) > 1:
        warnings.append("the models have different laws: there are no parameters of one of them")
    curves, parameters, unused = [], [], []
    for each in zip(*(drawn_cases(share, choice, of, seed) for share in shares), strict=True):
        case, kind = each[0].case, each[0].kind
        u = _displacements(case, displacement_mm, posterior)
        if not len(u):
            unused.append(case.label)
            continue
        curve = pd.DataFrame({"displacement_mm": u, **_bands(u, each, interval)})
        curves.append(curve.assign(**case._asdict(), of=f"{kind}{of}"))
        if len(laws) == 1:
            parameters.append(_parameters(each, interval))
    if unused:
        warnings.append(f"no displacement has the sign of {case_list(unused)}")
    if not curves:
        raise BadInput(f"{warnings[-1]}; give magnitudes, or both signs")
    constants = {"parameter": "force", "unit": "kN", "interval": interval, "origin": models[0].tree.attrs["origin"]}
    table = pd.concat(curves, ignore_index=True).assign(**constants, verdict=verdict)
    return Prediction(table[list(COLUMNS)], tuple(parameters), tuple(warnings))


def about_untested(untested: Sequence[Case], cases: Sequence[Case]) -> list[str]:
    """Return what is said of cases without records: what they are predicted from, and what lies beyond that."""
    if not untested:
        return []
    about = [f"not tested: {case_list([case.label for case in untested])}; predicted from the effects of what was"]
    if alone := without_opposite(untested, cases):
        about.append(f"no opposite direction of {case_list([case.label for case in alone])}")
    for factor, (word, unit) in _NUMBERS.items():
        of_tested, of_untested = (
            {abs(number) for case in each if (number := getattr(case, factor)) is not None}
            for each in (cases, untested)
        )
        beyond = [level for level in sorted(of_untested) if not min(of_tested) <= level <= max(of_tested)]
        if beyond and len(of_tested) == 1:
            about.append(f"{word} of every record: {min(of_tested):g} {unit}; of another, priors alone say something")
        elif beyond:
            levels = ", ".join(f"{level:g}" for level in beyond)
            span = f"{min(of_tested):g} to {max(of_tested):g} {unit}"
            about.append(f"{word} {levels} {unit} is beyond what was tested, {span}")
    return about


def predictable_cases(tree: xr.DataTree) -> list[Case]:
    """Return the cases of a posterior of records, in its order; None for factors that the data did not have.

    Raises
    ------
    BadInput
        For a tree that is no such posterior.
    """
    if "posterior" not in tree.children or "origin" not in tree.attrs:
        raise BadInput("is no posterior of this program; name a folder that fit wrote")
    posterior = with_records(tree)
    if "k_case" in posterior and "record" not in posterior.dims:
        raise BadInput("holds no records, so neither F_i nor J of a step; name a folder that fit wrote from records")
    dims = {name: {"chain", "draw", dim} for name, dim in _NEEDED.items()}
    lacking = [name for name, needed in dims.items() if name not in posterior or set(posterior[name].dims) != needed]
    lacking += [f"case_{factor}" for factor in CASE_FACTORS if f"case_{factor}" not in posterior.coords]
    if lacking:
        raise BadInput(f"is no posterior of records: it lacks {', '.join(lacking)}; name a folder that fit wrote")
    return tree_cases(posterior)


def _displacements(case: Case, asked: np.ndarray | None, posterior: xr.Dataset) -> Float[np.ndarray, " points"]:
    """Return the displacements (mm) for a case, signed; none where no displacement asked for is of its sign."""
    sign = sign_of(case)
    if asked is None:
        asked = np.linspace(0.0, travel_mm(posterior, case), DEFAULT_POINTS)
    if not sign:
        return asked
    if np.all(asked >= 0):
        return sign * asked + 0.0  # or zero would be written as -0.0
    mine = asked[sign * asked >= 0]
    return mine if np.any(mine != 0) else mine[:0]


def force_kN(
    u: np.ndarray, F_i: np.ndarray, J: np.ndarray, k: np.ndarray, beta: np.ndarray, law: str = EQUATION_2
) -> np.ndarray:
    """Return the force (kN) of a law at u (mm) from the start of the step; all other arguments broadcast together.

    In float64 whatever JAX is set to: what reads a finished posterior need not prepare JAX.
    """
    with jax.enable_x64(True):
        return F_i + np.asarray(_changes_of_force[law](u, k=k, J=J, beta=beta))


def _bands(u: np.ndarray, models: Sequence[DrawnCase], interval: float) -> dict[str, np.ndarray]:
    """Return median, lower and upper of the force (kN) at each displacement, a bounded number of them at once."""
    count, blocks = sum(len(model.draws.k) for model in models), []
    for part in np.array_split(u, -(-len(u) * count // CELLS)):
        force = np.concatenate([_forces(part, model) for model in models])
        blocks.append(median_lower_upper(force, interval))
    return dict(zip(("median", "lower", "upper"), np.concatenate(blocks, axis=1), strict=True))


def _forces(u: np.ndarray, model: DrawnCase) -> Float[np.ndarray, "draws points"]:
    """Return the force (kN) in each draw of a model, with the noise of each point where it has any."""
    draws = model.draws
    F_i, J, k, beta, sigma = (getattr(draws, name)[:, None] for name in ("F_i", "J", "k", "beta", "sigma"))
    force = force_kN(u, F_i, J, k, beta, model.law)
    if not sigma.any():
        return force
    nu = None if draws.noise_nu is None else draws.noise_nu[:, None]
    return force + sigma * draw_noise(model.rng, force.shape, nu)


def _parameters(models: Sequence[DrawnCase], interval: float) -> dict[str, object]:
    """Return what a vehicle model needs of one case, in plain numbers and text; nothing that is not known."""
    case, draws = models[0].case, joined([model.draws for model in models])
    draws_of_case = {
        name: np.concatenate([model.draws_of_case[name] for model in models]) for name in models[0].draws_of_case
    }
    factors = {factor: value for factor, value in case._asdict().items() if value not in (None, "")}
    values = {
        **{
            "k_kN_per_mm": draws_of_case.get("k", draws.k),
            "beta_mm": draws_of_case.get("beta", draws.beta),
            "J_kN": draws.J,
        },
        **{"C_kN": draws.C, "F_i_kN": draws.F_i, "d_i_mm": draws.d_i},
    }
    statistics = {name: _statistics(value, interval) for name, value in values.items() if np.isfinite(value).all()}
    return {"label": case.label, **factors, **({"tested": False} if models[0].kind else {}), **statistics}


def _statistics(values: np.ndarray, interval: float) -> dict[str, float]:
    _, lower, upper = median_lower_upper(values, interval)
    statistics = {"mean": values.mean(), "sd": values.std(ddof=1), "lower": lower, "upper": upper}
    return {name: float(value) for name, value in statistics.items()}
