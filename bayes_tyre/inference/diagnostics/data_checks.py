"""Checks of the data behind a posterior, and its limitations, each with what to do.

A failed check fails the verdict, however well the sampler did. A limitation (a quantity that is weakly identified or
prior-sensitive) fails nothing.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float

from bayes_tyre.inference.diagnostics.power_scaling import CONTRACTION_LEAST, GROUP, SENSITIVE, identified
from bayes_tyre.inference.diagnostics.prior_conflict import standard_errors_off
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.record import CASE_FACTORS

#: Standard deviation of log k, log beta, ... among repeats above which records are not repeats of one test: twice the
#: upper end of its prior.
SD_REPEAT_MOST = {"k": 0.5, "beta": 1.0, "settled": 1.0, "m": 0.3, "c": 1.0}
#: What would identify a parameter.
REMEDIES = {
    "k": "check the signs and columns of these records, or leave them out",
    "beta": "it needs several points within beta of the start, and travel well beyond it",
    "J": "it needs several points within beta of the start",
    "C": "it needs travel well beyond beta, and several points within beta of the start",
    "sigma": "it needs more points a record",
    "rho": "it needs more points a record",
    "x": "it needs a step much longer than beta, and rest before it",
    "settled": "it needs a step much longer than beta, and rest before it",
    "m": "it needs the ringing after the step; check the accelerometer's line and sign",
    "c": "it needs the ringing after the step, recorded until it has gone",
    "energy_per_cycle": "it follows x, k and beta",
}
#: Parameters that records may leave open: the interval is wide, and holds. Where k is open, signs or columns are wrong.
_MAY_BE_OPEN = ("beta", "J")
#: Most elements that a sentence names.
_NAMED = 3
#: Width of a posterior over its prior's from which on a quantity is weakly identified.
_WIDEST = np.sqrt(1 - CONTRACTION_LEAST)
#: What it means for the answer if a hyperparameter is poorly known, and what to do.
_OF_HYPERPARAMETERS = (
    "the intervals of cases and ratios allow for that; measure more cases or levels if these quantities themselves "
    "matter"
)
#: Standard errors that the records may be off a prior that somebody changed: of four groups, chance brings more in one
#: of a hundred fits.
_CONFLICT = 3.0
#: Least contraction that says how far printed means alone are off: below, it is Monte Carlo error.
_LEAST_CONTRACTION = 0.01
#: Least credible noise of a load cell, kN: a millinewton.
NOISE_LEAST_KN = 1e-6


def fault(where: str, finding: str, remedy: str) -> Check:
    """Return a fault of the records as a failed check: where it is, what is wrong, and what to do."""
    return Check("records", "data", False, np.nan, np.nan, where, f"{where}: {finding}", remedy)


def failed_checks(posterior: xr.Dataset, priors: Priors = PRIORS) -> list[Check]:
    """Return why the records cannot identify the parameters, a failed check each; none where they can.

    Parameters
    ----------
    posterior:
        Dims chain, draw and those of `bayes_tyre.inference.sampling.datatree.QUANTITIES`.
    """
    return [
        *_unidentified(posterior, priors),
        *_unlike_repeats(posterior),
        *_discordant_majority(posterior),
        *_noiseless(posterior),
    ]


class _OfGroup(NamedTuple):
    """A group's parameter beside its prior, such as ``k_group[dual loading]``, and ``k``.

    `share` is the width of its posterior over that of its prior, `open` says that its records do not determine it, and
    `stated` that the prior does by intention, being so much narrower than the default. The records are `off` a prior
    that somebody changed by so many standard errors.
    """

    element: str
    parameter: str
    share: float
    stated: bool
    off: float

    @property
    def open(self) -> bool:
        """Whether the posterior is little narrower than the prior."""
        return 1.0 - self.share**2 < CONTRACTION_LEAST

    @property
    def conflicting(self) -> bool:
        """Whether the records contradict a prior that somebody changed."""
        return self.off > _CONFLICT


def _groups(posterior: xr.Dataset, priors: Priors) -> Iterator[_OfGroup]:
    posterior = as_measured(posterior)  # priors know of no factor on displacement or force
    for parameter in REMEDIES:
        name = f"{parameter}_group"
        if name not in posterior or not priors[name].of_logarithm:
            continue
        draws = posterior[name].transpose("chain", "draw", "group")
        log_values, default = np.log(draws.to_numpy()), PRIORS[name].parameters
        share, of_default = (log_values.std(axis=(0, 1)) / each for each in (priors[name].parameters[1], default[1]))
        changed = priors[name].parameters != default
        off = _off(posterior, parameter, priors, log_values) if changed else np.zeros(len(share))
        for i, label in enumerate(draws["group"].to_numpy()):
            stated = bool(1.0 - of_default[i] ** 2 >= CONTRACTION_LEAST)
            yield _OfGroup(f"{name}[{label}]", parameter, float(share[i]), stated, float(off[i]))


def _off(
    posterior: xr.Dataset, parameter: str, priors: Priors, log_values: Float[np.ndarray, "chains draws groups"]
) -> Float[np.ndarray, " groups"]:
    """Return by how many standard errors the records are off the prior of each group.

    Printed case means are not in the posterior, and draws that are not finite are said elsewhere. There a normal prior
    and a normal likelihood are taken: the posterior's mean is off by the contraction times what the data are, and their
    variance is the prior's times (1 - contraction) / contraction.
    """
    if parameter in posterior and bool(np.isfinite(posterior[parameter]).all()):
        return standard_errors_off(posterior, parameter, priors)
    middle, sd = priors[f"{parameter}_group"].parameters
    contraction = np.maximum(1.0 - (log_values.std(axis=(0, 1)) / sd) ** 2, _LEAST_CONTRACTION)
    return np.abs(log_values.mean(axis=(0, 1)) - middle) / (sd * np.sqrt(contraction))


def _unidentified(posterior: xr.Dataset, priors: Priors) -> Iterator[Check]:
    for each in _groups(posterior, priors):
        if each.conflicting:
            what = "decided by the prior that was given" if each.open else "not where the prior that was given has it"
            finding = f"{what}, {each.off:.1f} standard errors off the records"
            yield fault(each.element, finding, "check the units of the records, or widen the prior")
        elif each.open and not each.stated and each.parameter not in _MAY_BE_OPEN:
            finding = f"not determined by the records: its posterior is {each.share:.0%} as wide as its prior"
            yield fault(each.element, finding, REMEDIES[each.parameter])


def decided_by_given_priors(posterior: xr.Dataset, priors: Priors) -> list[str]:
    """Return which parameters of groups a prior that somebody stated determines, and the records do not contradict."""
    return [
        f"{each.element}: decided by the prior that was given: its posterior is {each.share:.0%} as wide; say so where "
        "you quote it"
        for each in _groups(posterior, priors)
        if each.open and each.stated and not each.conflicting and each.parameter not in _MAY_BE_OPEN
    ]


def _unlike_repeats(posterior: xr.Dataset) -> Iterator[Check]:
    for parameter, most in SD_REPEAT_MOST.items():
        name = f"sd_log_{parameter}_repeat"
        if name in posterior and (sd := float(posterior[name].median())) > most:
            finding = f"repeats of a case differ by a factor of {np.exp(sd):.1f}: no value describes the case"
            remedy = "check that equal factors mean equal tests, and that all records have the same units"
            yield fault(name, finding, remedy)


def _discordant_majority(posterior: xr.Dataset) -> Iterator[Check]:
    if "outlier_probability" not in posterior:
        return
    discordant = (posterior["outlier_probability"].mean(("chain", "draw")) > 0.5).to_numpy()
    factor_table = pd.DataFrame(
        {name: posterior[f"record_{name}"] for name in CASE_FACTORS if f"record_{name}" in posterior.coords},
        index=range(len(discordant)),
    )
    factors = find_factors(factor_table)
    by_case = np.bincount(factors.of_record, weights=discordant, minlength=len(factors.cases))
    for case, count, repeats in zip(factors.cases, by_case, factors.repeats, strict=True):
        if repeats >= JUDGEABLE_REPEATS and 2 * count >= repeats:
            finding = f"{count:.0f} of its {repeats} repeats are discordant: no majority agrees"
            yield fault(f"k[{case.label}]", finding, "repeat the test")


def _noiseless(posterior: xr.Dataset) -> Iterator[Check]:
    if "sigma" not in posterior:
        return
    sigma = posterior["sigma"].median(("chain", "draw"))
    least = sigma.idxmin().item()
    if float(sigma.min()) < NOISE_LEAST_KN:
        finding = f"{float(sigma.min()):.1g} kN is less than a load cell's noise: computed records cannot be sampled"
        yield fault(f"sigma[{least}]", finding, "use lsq, or add noise of a load cell's size")


def find_limitations(tree: xr.DataTree) -> list[str]:
    """Return which quantities are weakly identified or prior-sensitive; nothing for a tree without `GROUP`.

    A group is named by its mean over cases (`_mean`) where there is one: the words for both are the same.
    """
    if GROUP not in tree.children:
        return []
    measures = {str(name): each for name, each in tree[GROUP].to_dataset().data_vars.items()}
    tables = {
        name: identified(tree, name).assign(element=_elements(each))
        for name, each in measures.items()
        if not (name.endswith("_group") and f"{_parameter(name)}_mean" in measures)
    }
    parameters = {name: table for name, table in tables.items() if _parameter(name) in REMEDIES}
    hyperparameters = pd.concat([table for name, table in tables.items() if name not in parameters])
    return [
        *_weakly_identified(parameters, hyperparameters),
        *_prior_sensitive(pd.concat(parameters.values()), hyperparameters),
    ]


def _parameter(name: str) -> str:
    """Return the parameter of a quantity of a case, a record or a group."""
    return name.removesuffix("_case").removesuffix("_mean").removesuffix("_group")


def _elements(measures: xr.DataArray) -> list[str]:
    dims = [dim for dim in measures.dims if dim != "measure"]
    if not dims:
        return [str(measures.name)]
    return [f"{measures.name}[{label}]" for label in measures[dims[0]].to_numpy()]


def _listed(elements: pd.Series) -> str:
    more = f" and {len(elements) - _NAMED} more in summary.csv" if len(elements) > _NAMED else ""
    return ", ".join(elements[:_NAMED]) + more


def _weakly_identified(parameters: dict[str, pd.DataFrame], hyperparameters: pd.DataFrame) -> Iterator[str]:
    for name, table in parameters.items():
        if not name.endswith("_group") and (weak := _weak(table)):
            yield f"{weak}; {REMEDIES[_parameter(name)]}"
    if weak := _weak(hyperparameters):
        yield f"{weak}; {_OF_HYPERPARAMETERS}"


def _weak(table: pd.DataFrame) -> str:
    """Return which quantities are weakly identified, the worst first, and how wide their posteriors still are.

    The width is that of a standard deviation, as the eye compares two curves.
    """
    weak = table[table["contraction"] < CONTRACTION_LEAST].sort_values("contraction", kind="stable")
    if weak.empty:
        return ""
    widest, narrowest = (f"{np.sqrt(max(1 - contraction, 0)):.0%}" for contraction in weak["contraction"].iloc[[0, -1]])
    width = widest if widest == narrowest else f"{widest} down to {narrowest}"
    return (
        f"{_listed(weak['element'])}: weakly identified: the posterior is {width} as wide as the prior (over "
        f"{_WIDEST:.0%})"
    )


def _prior_sensitive(parameters: pd.DataFrame, hyperparameters: pd.DataFrame) -> Iterator[str]:
    for table, remedy in (
        (parameters, "say so where you quote them, and measure more repeats or cases"),
        (hyperparameters, _OF_HYPERPARAMETERS),
    ):
        sensitive = table[table["decided_by"].isin(["prior", "both"])]
        sensitive = sensitive.sort_values("prior_sensitivity", ascending=False, kind="stable")
        if len(sensitive):
            yield (
                f"{_listed(sensitive['element'])}: prior-sensitive: a wider or narrower prior would move them "
                f"(power scaling: {sensitive['prior_sensitivity'].iloc[0]:.3f}, over {SENSITIVE}); {remedy}"
            )
