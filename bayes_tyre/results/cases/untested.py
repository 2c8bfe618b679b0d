"""Cases without records, by what a posterior says of their group and of the levels of their factors."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.factors import INTERACTIONS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import draws_in_a_row, tree_cases
from bayes_tyre.record import Case
from bayes_tyre.results.cases.draws import CaseValues, Start, records_like, start_of
from bayes_tyre.results.cases.level_trend import effects_by_trend

#: Factors whose levels are numbers along which effects may follow a trend.
_TRENDS = ("speed", "load", "step")


def has_slope(posterior: xr.Dataset) -> bool:
    """Return whether the initial load of a posterior is the force that each record really started from.

    That of a new case is then not known.
    """
    return "log_k_load" in posterior and posterior.sizes["load"] == 1


def untested_rng(posterior: xr.Dataset, seed: int = 0) -> np.random.Generator:
    """Return the random numbers of a case without records: whatever else is asked for, and by whatever command."""
    return np.random.default_rng((seed, posterior.sizes["case"]))


def untested(posterior: xr.Dataset, priors: Priors, case: Case, rng: np.random.Generator) -> CaseValues:
    """Return a case without records: k and beta as `log_values_of_untested` has them.

    F_i and J are at each draw those of one of the records of its configuration, direction and initial load. From a load
    that no record starts from, J is that of any, and F_i on the line through its means at the two nearest loads, or as
    much of the load as at the only one. Where a step starts in displacement is not known.

    Raises
    ------
    BadInput
        For a posterior with a slope over the force that records really started from, and for a load other than 0 where
        all records start from 0 kN.
    """
    if has_slope(posterior):
        raise BadInput(
            "was fitted with --initial-load actual: the force from which a case that was not tested would start is not "
            "known; fit without it, or name a case that was tested"
        )
    k, beta = (np.exp(log_values_of_untested(posterior, priors, name, [case], rng)[:, 0]) for name in ("k", "beta"))
    F_i, J = _start(posterior, case, rng)
    return CaseValues(case, k, beta, Start(F_i[:, None], J[:, None], np.full((len(k), 1), np.nan)))


def _start(
    posterior: xr.Dataset, case: Case, rng: np.random.Generator
) -> tuple[Float[np.ndarray, " draws"], Float[np.ndarray, " draws"]]:
    """Return draws of the force (kN) that a case without records starts from, and of its J (kN)."""
    alike = records_like(posterior, case, ("configuration", "direction", "initial_load_kN"))
    group = records_like(posterior, case, ("configuration", "direction"))
    start = start_of(posterior, alike or group)
    one = np.arange(len(start.F_i)), rng.integers(start.F_i.shape[1], size=len(start.F_i))
    if alike or case.initial_load_kN is None:
        return start.F_i[one], start.J[one]
    loads = posterior["record_initial_load_kN"].to_numpy()[group]
    nearest = sorted(np.unique(loads), key=lambda load: abs(load - case.initial_load_kN))[:2]
    means = [start.F_i[:, loads == load].mean(axis=1) for load in nearest]
    if len(nearest) == 1 and nearest[0] == 0:
        raise BadInput(
            "every record like it starts from 0 kN, which does not say the force at another load; name one of 0 kN"
        )
    if len(nearest) == 1:
        return means[0] * case.initial_load_kN / nearest[0], start.J[one]
    part = (case.initial_load_kN - nearest[0]) / (nearest[1] - nearest[0])
    return (1.0 - part) * means[0] + part * means[1], start.J[one]


def log_values_of_untested(
    posterior: xr.Dataset, priors: Priors, parameter: str, new: Sequence[Case], rng: np.random.Generator
) -> Float[np.ndarray, "draws new"]:
    """Return draws of a parameter's logarithm in new cases of the groups that a posterior has.

    They are of the linear predictor and the remainder, which is wider where a case stands apart. Effects of speeds,
    loads and steps that were not tested are drawn by `bayes_tyre.results.cases.level_trend`; those of an interaction,
    with the standard deviation of the interaction's effects.
    """
    values = _groups(posterior, parameter, new)
    levels = [_levels(case) for case in new]
    for factor in (*_TRENDS, *INTERACTIONS):
        asked = list(dict.fromkeys(of_case[factor] for of_case in levels))
        effects = _effects(posterior, priors, parameter, factor, asked, rng)
        values = [value + effects[of_case[factor]] for value, of_case in zip(values, levels, strict=True)]
    remainder = _sd(posterior, priors, f"sd_log_{parameter}_case", rng)
    apart_weight = priors.apart_weight if f"{parameter}_apart_probability" in posterior else 0.0
    wider = [np.where(rng.random(len(remainder)) < apart_weight, priors.apart_widening, 1.0) for _ in new]
    each = zip(values, wider, strict=True)
    drawn = [value + wide * remainder * rng.standard_normal(len(remainder)) for value, wide in each]
    return np.reshape(drawn, (len(new), len(remainder))).T


def _groups(posterior: xr.Dataset, parameter: str, new: Sequence[Case]) -> list[Float[np.ndarray, " draws"]]:
    """Return draws of the logarithm of the mean of each case's group."""
    name, labels = f"{parameter}_group", _labels(posterior, "group")
    wanted = [case.group for case in new]
    if name not in posterior or not set(wanted) <= set(labels):
        raise BadInput(f"lacks {name} of a case without records, so it is no posterior of fit or motion; run fit again")
    of_group = dict(zip(labels, log_draws(posterior, [name])[..., 0].T, strict=True))
    return [of_group[label] for label in wanted]


def log_draws(posterior: xr.Dataset, names: Sequence[str]) -> Float[np.ndarray, "draws units names"]:
    """Return the logarithms of draws of some variables, of one dimension beside chain and draw."""
    values = np.stack([draws_in_a_row(posterior[name]) for name in names], axis=-1)
    for name, positive in zip(names, np.moveaxis((values > 0) & np.isfinite(values), -1, 0), strict=True):
        if not positive.all():
            raise BadInput(f"{name} has draws that are not above 0; run fit or motion again")
    return np.log(values)


def _effects(
    posterior: xr.Dataset, priors: Priors, parameter: str, factor: str, asked: Sequence[str], rng: np.random.Generator
) -> Mapping[str, Float[np.ndarray, "#draws"]]:
    """Return draws of the effects of a factor's levels: of those tested, and of those asked for."""
    site = f"log_{parameter}_{factor}"
    levels = list(dict.fromkeys(_levels(case)[factor] for case in tree_cases(posterior)))
    effects = dict.fromkeys(levels, np.zeros(1))
    if site in posterior:
        levels = _labels(posterior, factor)
        effects |= dict(zip(levels, draws_in_a_row(posterior[site]).T, strict=True))
    new = [level for level in asked if level not in effects]
    # Where one configuration was tested, what a speed changes in it alone is in the effect of the speed already.
    absorbed = factor in INTERACTIONS and len({level.rpartition(" ")[0] for level in levels}) == 1
    if not new or absorbed or f"sd_{site}" not in priors:
        return effects | dict.fromkeys(new, np.zeros(1))
    sd = _sd(posterior, priors, f"sd_{site}", rng)
    if factor in _TRENDS and "" not in (*levels, *new):
        of_tested = np.stack([np.broadcast_to(effects[level], sd.shape) for level in levels], axis=1)
        drawn = effects_by_trend(np.array(levels, float), of_tested, np.array(new, float), sd, rng)
    else:
        # Effects are deviations from the mean of the levels in the data, itself uncertain by sd^2 / levels.
        widened = np.sqrt(1.0 + 1.0 / len(levels)) * sd
        drawn = widened[:, None] * rng.standard_normal((len(sd), len(new)))
    return effects | dict(zip(new, drawn.T, strict=True))


def _sd(posterior: xr.Dataset, priors: Priors, site: str, rng: np.random.Generator) -> Float[np.ndarray, " draws"]:
    """Return draws of a standard deviation; of a factor that did not vary, its prior's."""
    draws = posterior.sizes["chain"] * posterior.sizes["draw"]
    return draws_in_a_row(posterior[site]) if site in posterior else priors[site].scipy().rvs(draws, random_state=rng)


def _levels(case: Case) -> dict[str, str]:
    """Return the level of each factor of a linear predictor as a posterior labels it."""
    speed, load = ("" if value is None else str(float(value)) for value in case[2:4])
    sizes = ("" if value is None else f"{abs(value):g}" for value in (case.step_kN, *case[2:4]))
    step, *of_configuration = sizes
    levels = {"speed": speed, "load": load, "step": step, "direction_step": f"{case.direction or ''} {step}".strip()}
    for factor, level in zip(("speed", "load"), of_configuration, strict=True):
        levels[f"configuration_{factor}"] = f"{case.configuration or ''} {level}".strip()
    return levels


def _labels(posterior: xr.Dataset, dim: str) -> list[str]:
    return [str(label) for label in posterior[dim].to_numpy().tolist()] if dim in posterior.coords else [""]
