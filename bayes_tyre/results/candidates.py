"""The tests that could be run next, and what a posterior says of them: repeats of its cases, and new cases."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import as_measured, case_parameters, priors_of, tree_cases
from bayes_tyre.record import AXLE_PARAMETERS, LAW_PARAMETERS, Case
from bayes_tyre.results.case_draws import factors_along, flat, scatter_of_repeats

#: Factors that a rig sets to numbers; most new cases that are looked at.
LEVELS, MOST_NEW = ("speed_km_h", "initial_load_kN", "step_kN"), 2000
#: Draws that a mean over standard deviations is taken over.
_FEW = 400
#: Least information of a record's points on its parameters, relative to what its case says of them.
_LEAST_INFORMATION = 0.02


class Candidates(NamedTuple):
    """Cases that can be tested, and what a posterior holds of the logarithms of their values.

    Attributes
    ----------
    cases, with_records:
        Those that have records, so many, then those that are new.
    parameters:
        What the cases have values of: first what a record measures, then what follows from it.
    log_values:
        Of a new case the linear predictor of what a record measures, and 0 of the rest.
    remainder:
        Variance of each case about that: 0 for a case with records.
    noise:
        Covariance of a record's estimate about its case: repeats and error of estimation.
    log_scale:
        Logarithm of the factor on each parameter by which displacement is uncertain in all records.
    """

    cases: tuple[Case, ...]
    with_records: int
    parameters: tuple[str, ...]
    log_values: Float[np.ndarray, "draws cases parameters"]
    remainder: Float[np.ndarray, "cases parameters"]
    noise: Float[np.ndarray, "cases measured measured"]
    log_scale: Float[np.ndarray, "draws parameters"]

    @property
    def covariance(self) -> Float[np.ndarray, "values values"]:
        """Covariance of the logarithms of all values, a case's together."""
        of_draws = np.cov(self.log_values.reshape(len(self.log_values), -1), rowvar=False)
        return np.atleast_2d(of_draws) + np.diag(self.remainder.ravel())


def new_cases(cases: Sequence[Case], levels: Mapping[str, Sequence[float]]) -> list[Case]:
    """Return the cases without records that combine the groups and levels of cases.

    Parameters
    ----------
    cases:
        Those with records. A new one has the configuration and direction of one of them, a step of the sign that its
        direction has, and loads that are within those met.
    levels:
        What a factor of `LEVELS` can be set to, in place of the levels of the cases.

    Raises
    ------
    BadInput
        If there are more than `MOST_NEW`.
    """
    groups = dict.fromkeys((case.configuration, case.direction) for case in cases)
    of_factor = [levels.get(name) or sorted({getattr(case, name) for case in cases}, key=str) for name in LEVELS]
    signs = {(case.direction, np.sign(case.step_kN or 0.0)) for case in cases}
    loads = [load for case in cases for load in _loads(case)] + list(levels.get("initial_load_kN", ()))
    found = []
    for group, *rest in product(groups, *of_factor):
        case = Case(*group, *rest)
        within = all(min(loads) <= load <= max(loads) for load in _loads(case))
        if within and (case.direction, np.sign(case.step_kN or 0.0)) in signs and case not in cases:
            found.append(case)
    if len(found) > MOST_NEW:
        raise BadInput(f"{len(found)} new cases are too many to compare; name fewer levels under [rig] of --cost")
    return found


def _loads(case: Case) -> list[float]:
    """Return the loads that a case begins and ends at, kN; none where it does not say."""
    if case.initial_load_kN is None:
        return []
    return [case.initial_load_kN, round(case.initial_load_kN + (case.step_kN or 0.0), 9)]


def candidates(tree: xr.DataTree, new: Sequence[Case], seed: int = 0) -> Candidates:
    """Return what a posterior of records or motions holds of its own cases and of new ones.

    `seed` is of the effects of levels that it does not have, and of standard deviations that only their priors know.

    Raises
    ------
    BadInput
        If the posterior has no repeats.
    """
    posterior, priors, rng = tree["posterior"].to_dataset(), priors_of(tree), np.random.default_rng(seed)
    cases, as_read = tree_cases(posterior), as_measured(posterior)
    measured = [name for name in (*LAW_PARAMETERS, *AXLE_PARAMETERS) if f"sd_log_{name}_repeat" in posterior]
    if not measured or "record" not in posterior.dims:
        raise BadInput("the posterior has no repeats, so it does not say what one more would add; fit a record table")
    parameters = tuple(dict.fromkeys((*measured, *case_parameters(posterior))))
    known = np.log(np.stack([flat(as_read[f"{name}_case"]) for name in parameters], axis=-1))
    scaled = np.log(np.stack([flat(posterior[f"{name}_case"])[:, 0] for name in parameters], axis=-1))
    predicted = np.zeros((len(known), len(new), len(parameters)))
    remainder = np.zeros((len(cases) + len(new), len(parameters)))
    for p, name in enumerate(measured):
        predicted[:, :, p] = _linear_predictor(posterior, priors, name, new, rng)
        remainder[len(cases) :, p] = np.mean(_sd(posterior, priors, f"sd_log_{name}_case", rng) ** 2)
    return Candidates(
        (*cases, *new),
        len(cases),
        parameters,
        np.concatenate([known, predicted], axis=1),
        remainder,
        _noise(as_read, priors, measured, [*cases, *new], known[:, :, : len(measured)]),
        scaled - known[:, 0],
    )


def _linear_predictor(
    posterior: xr.Dataset, priors: Priors, parameter: str, new: Sequence[Case], rng: np.random.Generator
) -> Float[np.ndarray, "draws new"]:
    """Return the linear predictor of a parameter's logarithm in new cases of the groups that a posterior has."""
    groups = _labels(posterior, "group")
    chosen = [groups.index(f"{case.configuration or ''} {case.direction or ''}".strip()) for case in new]
    total = np.log(flat(posterior[f"{parameter}_group"])).reshape(-1, len(groups))[:, chosen]
    for factor, level_of in _LEVEL_OF.items():
        site, levels = f"log_{parameter}_{factor}", {level_of(case) for case in tree_cases(posterior)}
        known = _labels(posterior, factor) if site in posterior else []
        effects = dict.fromkeys(levels, np.zeros(len(total))) | {
            level: flat(posterior[site])[:, i] for i, level in enumerate(known)
        }
        for level in dict.fromkeys(map(level_of, new)):
            if level not in effects and f"sd_{site}" in priors:
                # Effects are deviations from the mean of the levels in the data, itself uncertain by sd^2 / levels.
                sd = np.sqrt(1.0 + 1.0 / len(levels)) * _sd(posterior, priors, f"sd_{site}", rng)
                effects[level] = sd * rng.standard_normal(len(sd))
        total = total + np.stack([effects.get(level_of(case), np.zeros(len(total))) for case in new], axis=-1)
    return total


def _step(case: Case) -> str:
    return "" if case.step_kN is None else f"{abs(case.step_kN):g}"


#: The level of each factor of a linear predictor, as its label in a posterior.
_LEVEL_OF: dict[str, Callable[[Case], str]] = {
    "speed": lambda case: "" if case.speed_km_h is None else str(float(case.speed_km_h)),
    "load": lambda case: "" if case.initial_load_kN is None else str(float(case.initial_load_kN)),
    "step": _step,
    "direction_step": lambda case: f"{case.direction or ''} {_step(case)}".strip(),
}


def _labels(posterior: xr.Dataset, dim: str) -> list[str]:
    return [str(label) for label in posterior[dim].to_numpy().tolist()] if dim in posterior.coords else [""]


def _sd(posterior: xr.Dataset, priors: Priors, site: str, rng: np.random.Generator) -> Float[np.ndarray, " draws"]:
    """Return a standard deviation; from its prior where the posterior has none, as of a factor that did not vary."""
    if site in posterior:
        return flat(posterior[site])
    return priors[site].scipy().rvs(posterior.sizes["chain"] * posterior.sizes["draw"], random_state=rng)


def _noise(
    posterior: xr.Dataset,
    priors: Priors,
    measured: Sequence[str],
    cases: Sequence[Case],
    log_cases: Float[np.ndarray, "draws known measured"],
) -> Float[np.ndarray, "cases measured measured"]:
    """Return the covariance of a record's estimate about its case: that of like records, averaged over the draws."""
    left, of_record = _given_case(posterior, measured, log_cases)
    few = slice(None, None, max(1, len(log_cases) // _FEW))
    by_kind: dict[tuple[object, ...], np.ndarray] = {}
    for kind in dict.fromkeys(case[:3] for case in cases):
        scatter = np.stack([scatter_of_repeats(posterior, name, kind[2]) for name in measured], axis=1)
        like = [i for i, case in enumerate(of_record) if cases[case][:3] == kind] or slice(None)
        error = _estimation_error(left[:, like], np.sqrt(np.mean(scatter**2, axis=0)))
        by_kind[kind] = _record_noise(posterior, priors, scatter[few] ** 2, error, few)
    return np.stack([by_kind[case[:3]] for case in cases])


def _given_case(
    posterior: xr.Dataset, measured: Sequence[str], log_cases: Float[np.ndarray, "draws known measured"]
) -> tuple[Float[np.ndarray, "draws records measured"], list[int]]:
    """Return the logarithms of the records' values less what their cases say of them, and the case of each record."""
    cases = factors_along(posterior, "case")
    of_record = [cases.index(factors) for factors in factors_along(posterior, "record")]
    left = np.log(np.stack([flat(posterior[name]) for name in measured], axis=-1))
    left -= left.mean(axis=0)
    centred = log_cases - log_cases.mean(axis=0)
    for i, case in enumerate(of_record):
        left[:, i] -= centred[:, case] @ np.linalg.lstsq(centred[:, case], left[:, i], rcond=None)[0]
    return left, of_record


def _estimation_error(
    left: Float[np.ndarray, "draws like measured"], scatter: Float[np.ndarray, " measured"]
) -> Float[np.ndarray, "measured measured"]:
    """Return the covariance of the error with which the points of a record determine its parameters.

    Given its case, a record has the information of its points and 1 / scatter^2 of the case: the latter is taken off.
    """
    relative = (left / scatter).reshape(-1, len(scatter))
    values, vectors = np.linalg.eigh(np.linalg.inv(relative.T @ relative / len(relative)) - np.eye(len(scatter)))
    return (vectors / np.maximum(values, _LEAST_INFORMATION)) @ vectors.T * np.outer(scatter, scatter)


def _record_noise(
    posterior: xr.Dataset,
    priors: Priors,
    variance: Float[np.ndarray, "few measured"],
    error: Float[np.ndarray, "measured measured"],
    few: slice,
) -> Float[np.ndarray, "measured measured"]:
    """Return the covariance of a normal error that says as much of the case as a record does, on average over draws.

    A discordant repeat says little of its case, but it does not mislead, for the model knows it by its distance: what
    counts is the mean information of usual and discordant repeats, or that of a Student-t.
    """
    measured, eye = variance.shape[1], np.eye(variance.shape[1])
    if "student_nu" in posterior:
        nu = flat(posterior["student_nu"])[few, None]
        variance = variance * (nu + measured + 2) / (nu + measured)
    if "discordant_weight" not in posterior:
        return np.mean(variance[:, :, None] * eye, axis=0) + error
    weight = flat(posterior["discordant_weight"])[few, None, None]
    usual, discordant = (
        np.linalg.inv(wider**2 * variance[:, :, None] * eye + error) for wider in (1.0, priors.discordant_widening)
    )
    return np.linalg.inv((1.0 - weight) * usual + weight * discordant).mean(axis=0)
