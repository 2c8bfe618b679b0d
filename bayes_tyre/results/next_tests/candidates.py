"""The tests that could be run next, and what a posterior says of them: repeats of its cases, and new cases."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import LEVELS as LEVELS_OF_RECORDS
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import case_parameters, draws_in_a_row, priors_of, tree_cases
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import AXLE_PARAMETERS, LAW_PARAMETERS, Case
from bayes_tyre.results.cases.draws import factors_along, sd_of_repeats
from bayes_tyre.results.cases.untested import log_draws, log_values_of_untested

#: Factors that a rig sets to numbers; most new cases that are compared.
LEVELS, MOST_NEW = ("speed_km_h", "initial_load_kN", "step_kN"), 2000
#: Draws that a mean over standard deviations is taken over.
_FEW = 400
#: Least information of a record's points on its parameters, relative to what its case says of them.
_LEAST_INFORMATION = 0.02


class Candidates(NamedTuple):
    """Cases that can be tested, and what a posterior holds of them.

    Attributes
    ----------
    cases, with_records:
        Those that have records, so many, then the new ones.
    parameters:
        What cases have values of: first what a record measures, then what follows from it.
    log_values:
        Logarithms of the cases' values, displacement as it was measured; 0 for what follows in new cases.
    noise:
        Covariance of a record's estimate about its case: scatter of repeats and error of estimation.
    """

    cases: tuple[Case, ...]
    with_records: int
    parameters: tuple[str, ...]
    log_values: Float[np.ndarray, "draws cases parameters"]
    noise: Float[np.ndarray, "cases measured measured"]


def new_cases(cases: Sequence[Case], levels: Mapping[str, Sequence[float] | None]) -> list[Case]:
    """Return the cases without records that combine groups and levels, with a step of the direction's sign.

    Their loads are within those met. `levels` of a factor of `LEVELS` take the place of those of the cases. More than
    `MOST_NEW` are refused as `BadInput`.
    """
    groups, tested = dict.fromkeys(case[:2] for case in cases), set(cases)
    of_factors = [levels.get(name) or dict.fromkeys(getattr(case, name) for case in cases) for name in LEVELS]
    signs = {(case.direction, np.sign(case.step_kN or 0.0)) for case in cases}
    loads = [*(levels.get("initial_load_kN") or ()), *(load for case in cases for load in _loads(case))]
    every = [Case(*group, *values) for group in groups for values in product(*of_factors)]
    untested = [
        case
        for case in every
        if case not in tested
        and (case.direction, np.sign(case.step_kN or 0.0)) in signs
        and all(min(loads) <= load <= max(loads) for load in _loads(case))
    ]
    if len(untested) > MOST_NEW:
        raise BadInput(f"{len(untested)} new cases are too many to compare; name fewer levels under [rig] of --cost")
    return untested


def _loads(case: Case) -> list[float]:
    """Return the loads that a case begins and ends at, kN, as far as they are given."""
    if case.initial_load_kN is None:
        return []
    return [case.initial_load_kN, round(case.initial_load_kN + (case.step_kN or 0.0), 9)]


def candidates(tree: xr.DataTree, new: Sequence[Case], seed: int = 0) -> Candidates:
    """Return what a posterior of records or motions holds of its own cases and of new ones.

    Draws of a new case are made, by `seed`, as `bayes_tyre.results.cases.untested` says. A posterior without repeats is
    refused as `BadInput`, and so is one that was damaged: with values that have no logarithm, or records of no case.
    """
    posterior, priors, rng = as_measured(tree["posterior"].to_dataset()), priors_of(tree), np.random.default_rng(seed)
    measured = [name for name in (*LAW_PARAMETERS, *AXLE_PARAMETERS) if f"sd_log_{name}_repeat" in posterior]
    if not measured or "record" not in posterior.dims:
        raise BadInput("the posterior has no repeats, so it does not say what one more would add; fit a record table")
    if grouped := [level for level in LEVELS_OF_RECORDS if f"record_{level}" in posterior.coords]:
        raise BadInput(
            f"was fitted with --{grouped[0]}: what a test adds depends on the {grouped[0]} it is made on, which is not "
            f"forecast; fit without --{grouped[0]}"
        )
    cases, parameters = tree_cases(posterior), tuple(dict.fromkeys((*measured, *case_parameters(posterior))))
    log_values = log_draws(posterior, [f"{name}_case" for name in parameters])
    predicted = np.zeros((len(log_values), len(new), len(parameters)))
    for p, name in enumerate(measured):
        predicted[:, :, p] = log_values_of_untested(posterior, priors, name, new, rng)
    together = as_measured(with_records(tree))
    of_cases = log_draws(together, [f"{name}_case" for name in measured])
    noise = _noise(together, priors, measured, [*cases, *new], of_cases)
    return Candidates((*cases, *new), len(cases), parameters, np.concatenate([log_values, predicted], axis=1), noise)


def _noise(
    posterior: xr.Dataset,
    priors: Priors,
    measured: Sequence[str],
    cases: Sequence[Case],
    log_cases: Float[np.ndarray, "draws known measured"],
) -> Float[np.ndarray, "cases measured measured"]:
    """Return the covariance of a record's estimate about its case: that of like records, for each case."""
    of_cases, records = factors_along(posterior, "case"), factors_along(posterior, "record")
    if not set(records) <= set(of_cases):
        raise BadInput("has a record that is of none of its cases; run fit or motion again")
    of_record = [of_cases.index(factors) for factors in records]
    left = log_draws(posterior, measured)
    left, centred = left - left.mean(axis=0), log_cases - log_cases.mean(axis=0)
    for i, case in enumerate(of_record):  # what its case does not say of a record
        left[:, i] -= centred[:, case] @ np.linalg.lstsq(centred[:, case], left[:, i], rcond=None)[0]
    of_kind: dict[tuple[object, ...], np.ndarray] = {}
    for kind in dict.fromkeys(case[:3] for case in cases):
        like = [i for i, case in enumerate(of_record) if cases[case][:3] == kind] or slice(None)
        sd_repeat = np.stack([sd_of_repeats(posterior, name, kind[2]) for name in measured], axis=1)
        if not ((sd_repeat > 0) & np.isfinite(sd_repeat)).all():
            raise BadInput("the scatter of its repeats has draws that are not above 0; run fit or motion again")
        of_kind[kind] = _record_noise(posterior, priors, sd_repeat, left[:, like])
    return np.stack([of_kind[case[:3]] for case in cases])


def _record_noise(
    posterior: xr.Dataset,
    priors: Priors,
    sd_repeat: Float[np.ndarray, "draws measured"],
    left: Float[np.ndarray, "draws like measured"],
) -> Float[np.ndarray, "measured measured"]:
    """Return the covariance of a normal error that says as much of a case as one record does, averaged over the draws.

    A discordant repeat says little of its case, but it does not mislead, for the model knows it by its distance: what
    counts is the mean information of usual and discordant repeats, or that of a Student-t.
    """
    sd, eye = np.sqrt(np.mean(sd_repeat**2, axis=0)), np.eye(sd_repeat.shape[1])
    relative = (left / sd).reshape(-1, len(sd))
    # Given its case, a record has the information of its points, and of the case 1 / scatter^2, which is taken off.
    values, vectors = np.linalg.eigh(np.linalg.inv(relative.T @ relative / len(relative)) - eye)
    error = (vectors / np.maximum(values, _LEAST_INFORMATION)) @ vectors.T * np.outer(sd, sd)
    few = slice(None, None, max(1, len(sd_repeat) // _FEW))
    variance = sd_repeat[few, :, None] ** 2 * eye
    if "student_nu" in posterior:
        nu = draws_in_a_row(posterior["student_nu"])[few, None, None]
        variance = variance * (nu + len(sd) + 2) / (nu + len(sd))
    weight = (
        draws_in_a_row(posterior["discordant_weight"])[few, None, None] if "discordant_weight" in posterior else 0.0
    )
    usual, discordant = (np.linalg.inv(wider**2 * variance + error) for wider in (1.0, priors.discordant_widening))
    return np.linalg.inv((1.0 - weight) * usual + weight * discordant).mean(axis=0)
