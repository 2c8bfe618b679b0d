"""Checks of a posterior's cases against their repeats: whether the hierarchy says what the records say."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from scipy import stats

from bayes_tyre.inference.diagnostics.course_checks import CHANCE, LEAST_FREEDOM, case_of_records
from bayes_tyre.inference.diagnostics.sampling_checks import Check, unchecked
from bayes_tyre.inference.model.hyperparameters import APART_REPEATS, JUDGEABLE_REPEATS
from bayes_tyre.inference.sampling.datatree import case_parameters, draws_in_a_row, record_offset
from bayes_tyre.plain_text import listed

_INTERVAL = [0.025, 0.5, 0.975]
#: Probability of being discordant from which on a record does not count as one of the repeats that agree; and of
#: standing apart from which on a case is named.
_DISCORDANT = _APART = 0.5


def repeat_checks(posterior: xr.Dataset) -> Iterator[Check]:
    """Yield, by parameter, whether cases agree with their repeats as well as these agree among themselves.

    In each draw the mean of a case's repeats is normal about the case with the scatter of the repeats: mean squares of
    repeats about their case's value and about their own mean then have the ratio of an F distribution, whatever the
    scatter is. It is taken by speed, where scatter may differ. A remainder that is forced to be small, such as a
    normal one about a case that is unlike all others, drives the ratio up. Cases that stand apart from the others, and
    are therefore not drawn to them, are named in the note.

    Parameters
    ----------
    posterior:
        Dims chain, draw, record, case; k, k_case, ... of each.

    Source: a realised discrepancy (Gelman, Meng and Stern 1996) that has a known distribution; the median over draws.
    """
    case = case_of_records(posterior)
    for parameter in case_parameters(posterior):
        if parameter in posterior:
            # As if on the average specimen and day, as the case is.
            own = posterior[parameter] * np.exp(-record_offset(posterior, parameter))
            yield _cases_and_repeats(posterior.assign({parameter: own}), parameter, case)


class _Agreement(NamedTuple):
    """Probability that repeats are so far off their cases, and which case's are farthest."""

    p_value: float
    case: int


def _cases_and_repeats(posterior: xr.Dataset, parameter: str, case: Int[np.ndarray, " records"]) -> Check:
    name = f"cases_and_repeats_{parameter}"
    apart, outside = _apart(posterior, parameter, case), _outside(posterior, parameter, case)
    agreements = [agreement for agreement in _by_speed(posterior, parameter, case) if agreement is not None]
    if not agreements:
        why = f"fewer than {LEAST_FREEDOM} repeats beyond one of each case"
        return unchecked(name, CHANCE, why)._replace(note="; ".join(filter(None, (apart, outside))))
    worst = min(agreements, key=lambda agreement: agreement.p_value)
    value = min(worst.p_value * len(agreements), 1.0)
    label = str(posterior["case"].to_numpy()[worst.case])
    own = posterior[f"{parameter}_case"][:, :, worst.case]
    repeats = posterior[parameter].median(("chain", "draw")).to_numpy()[case == worst.case]
    finding = (
        f"{parameter}_case[{label}]: {float(own.median()):.3g}, where its repeats agree on {np.median(repeats):.3g}: "
        "cases that are unlike the others are drawn to these"
    )
    remedy = "take its repeats (repeats.csv) in place of the case (cases.csv), or fit such cases by themselves"
    passed = value >= CHANCE
    where, note = "" if passed else label, "; ".join(filter(None, (apart, outside if passed else "")))
    return Check(name, "model", passed, value, CHANCE, where, finding, remedy, note)


def _apart(posterior: xr.Dataset, parameter: str, case: Int[np.ndarray, " records"]) -> str:
    """Return which cases are likelier than not to stand apart from the others."""
    if f"{parameter}_apart_probability" not in posterior:
        return ""
    probability = posterior[f"{parameter}_apart_probability"].mean(("chain", "draw")).to_series()
    repeats = np.bincount(case, minlength=len(probability))
    likely = probability[(probability > _APART) & (repeats >= APART_REPEATS)].sort_values(ascending=False)
    named = listed([f"{label} ({value:.2f})" for label, value in likely.items()], 3)
    return (
        f"{parameter}_case: probably apart from the other cases, which then say little of them: {named}"
        if named
        else ""
    )


def _outside(posterior: xr.Dataset, parameter: str, case: Int[np.ndarray, " records"]) -> str:
    """Return which cases have an interval that holds none of their repeats; chance has some where cases are alike."""
    own, of_case = (posterior[name].quantile(_INTERVAL, ("chain", "draw")) for name in (parameter, f"{parameter}_case"))
    middle = own.sel(quantile=0.5).to_numpy()
    lower, median, upper = of_case.to_numpy()
    excluding = []
    for i, label in enumerate(posterior["case"].to_numpy()):
        repeats = middle[case == i]
        if len(repeats) >= JUDGEABLE_REPEATS and (repeats.min() > upper[i] or repeats.max() < lower[i]):
            low, high = repeats.min(), repeats.max()
            excluding.append(f"{label} ({median[i]:.3g}, its repeats {low:.3g} to {high:.3g})")
    if not excluding:
        return ""
    return (
        f"{parameter}_case: intervals hold none of their repeats, for other cases say otherwise: {listed(excluding, 3)}"
    )


def _by_speed(posterior: xr.Dataset, parameter: str, case: Int[np.ndarray, " records"]) -> Iterator[_Agreement | None]:
    """Yield the agreement at each speed, of records that are not discordant."""
    values, of_case = (np.log(draws_in_a_row(posterior[name])) for name in (parameter, f"{parameter}_case"))
    usual = np.ones(len(case), dtype=bool)
    if "outlier_probability" in posterior:
        usual = (posterior["outlier_probability"].mean(("chain", "draw")) < _DISCORDANT).to_numpy()
    speed = np.zeros(len(case))
    if "record_speed_km_h" in posterior.coords:
        speed = np.nan_to_num(posterior["record_speed_km_h"].to_numpy().astype(float))
    for level in np.unique(speed):
        chosen = usual & (speed == level)
        yield _agreement(values[:, chosen], of_case, case[chosen])


def _agreement(
    values: Float[np.ndarray, "draws records"],
    of_case: Float[np.ndarray, "draws cases"],
    case: Int[np.ndarray, " records"],
) -> _Agreement | None:
    repeats = np.bincount(case, minlength=of_case.shape[1])
    several = repeats > 1
    freedom = int((repeats[several] - 1).sum())
    if freedom < LEAST_FREEDOM:
        return None
    member = np.equal.outer(np.arange(of_case.shape[1]), case).astype(float)
    mean = values @ member.T / np.maximum(repeats, 1)
    within = np.sum(np.where(several[case], values - mean[:, case], 0.0) ** 2, axis=1) / freedom
    between = np.where(several, repeats * (mean - of_case) ** 2, 0.0)
    count = int(several.sum())
    of_all = stats.f.sf(np.median(between.sum(axis=1) / count / within), count, freedom)
    each = np.median(between / within[:, None], axis=0)
    of_worst = count * stats.f.sf(each.max(), 1, freedom)
    return _Agreement(float(min(2.0 * of_all, 2.0 * of_worst, 1.0)), int(np.argmax(each)))
