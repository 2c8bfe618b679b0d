"""Identifiability of each quantity: contraction of its prior, and power-scaling sensitivity to prior and likelihood."""

import warnings
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr
from arviz_stats.psense import psense

from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.diagnostics.log_densities import (
    log_likelihood_of_print,
    log_likelihood_of_records,
    log_prior,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites, published_sites
from bayes_tyre.inference.model.models import published_model, records_model
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.prior_predictive import draw_prior, usual_repeats, without_points
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import PROBABILITIES, QUANTITIES, to_datatree
from bayes_tyre.inference.sampling.group_means import named_group_means
from bayes_tyre.record import CASE_FACTORS

#: The group of a posterior's tree that holds all this, and what stands along its dimension `measure`.
GROUP = "identifiability"
MEASURES = ("contraction", "prior_sensitivity", "likelihood_sensitivity")
#: Contraction below which a quantity is weakly identified: the posterior is over 0.7 times as wide as its prior.
CONTRACTION_LEAST = 0.5
#: Sensitivity from which on ArviZ calls a prior informative.
SENSITIVE = 0.05
#: Most and fewest draws of the prior, and the most numbers (draws times records) of one quantity. The standard error of
#: a ratio of variances is 2 % of it with 4000 draws, 7 % with 400.
PRIOR_DRAWS, _PRIOR_DRAWS_LEAST, _PRIOR_NUMBERS = 4000, 400, 1_000_000
#: What is drawn of the prior: all that a posterior holds, but what is a probability itself.
PRIOR_SITES = tuple(name for name in QUANTITIES if name not in PROBABILITIES)
#: Draws of the posterior that sensitivities rest on, evenly taken; and quantities of pure noise beside them.
DRAWS, _NOISES = 2000, 20

_SAMPLE = ("chain", "draw")
_LOGARITHMIC = frozenset(
    f"{name}{ending}"
    for name in (
        *(site.removesuffix("_group") for site in PRIORS if site.endswith("_group") and PRIORS[site].of_logarithm),
        *("x", "sigma", "energy_per_cycle"),
    )
    for ending in ("", "_case", "_mean")
)


def on_prior_scale(name: str, values: xr.DataArray, priors: Priors = PRIORS) -> xr.DataArray:
    """Return values of a quantity on the scale that its prior is given on: mostly the logarithm."""
    if name == "rho":
        return values.copy(data=np.arctanh(values.to_numpy()))
    of_logarithm = priors[name].of_logarithm if name in priors else name in _LOGARITHMIC or name.endswith("_by_speed")
    return values.copy(data=np.log(values.to_numpy())) if of_logarithm else values


def contraction(posterior: xr.Dataset, prior: xr.Dataset, priors: Priors = PRIORS) -> xr.Dataset:
    """Return 1 - (variance of the posterior / of the prior) of each element, on the scale the prior is given on.

    0 where the data add no information, 1 where they determine it; below 0 where the posterior is wider than its
    prior. What is in one of the two alone is left out. Source: Betancourt (2018), "Towards a principled Bayesian
    workflow".
    """
    contractions = {}
    with np.errstate(divide="ignore", invalid="ignore"):  # the verdict reports draws that are not finite
        for name in (str(name) for name in posterior.data_vars if name in prior):
            of_posterior, of_prior = (
                on_prior_scale(name, each[name], priors).var(_SAMPLE) for each in (posterior, prior)
            )
            contractions[name] = 1.0 - of_posterior / of_prior
    return xr.Dataset(contractions)


def sensitivity(quantities: xr.Dataset, log_prior: xr.Dataset, log_likelihood: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return how far each element moves as its prior, or the likelihood, is raised to a power: ArviZ's `psense`.

    Keys ``prior_sensitivity`` and ``likelihood_sensitivity``; each dataset's attribute `floor` is the largest of
    `_NOISES` quantities that depend on nothing, so what Monte Carlo error alone gives. Where a density is no number
    there is nothing to weigh, and nothing is returned; quantities that are none are left out. Where the largest weights
    are equal, as stuck chains leave them, ArviZ raises ValueError.

    In a hierarchy only the top-level priors are scaled, those that `log_prior` holds. The likelihood of many records
    has much in it that bears on no case: its floor is then above most sensitivities, which are then not significant.
    `contraction` says whether the data identify a quantity.
    """
    finite = {name: draws for name, draws in quantities.data_vars.items() if np.isfinite(draws.to_numpy()).all()}
    densities = [density.to_numpy() for group in (log_prior, log_likelihood) for density in group.data_vars.values()]
    if not finite or not all(np.isfinite(density).all() for density in densities):
        return {}
    shape = (*(quantities.sizes[dim] for dim in _SAMPLE), _NOISES)
    noise = xr.DataArray(np.random.default_rng(0).standard_normal(shape), dims=(*_SAMPLE, "noise"))
    groups = {"posterior": xr.Dataset({**finite, "noise_": noise}), "log_prior": log_prior}
    tree, sensitivities = xr.DataTree.from_dict({**groups, "log_likelihood": log_likelihood}), {}
    with np.errstate(divide="ignore", invalid="ignore"), warnings.catch_warnings():
        # What never varies has no sensitivity, and of few draws the weights are poor, which the floor then shows.
        warnings.simplefilter("ignore", UserWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        for group in ("prior", "likelihood"):
            each = psense(tree, group=group)
            floor = float(each["noise_"].max())
            sensitivities[f"{group}_sensitivity"] = each.drop_vars(["noise_"]).assign_attrs(floor=floor)
    return sensitivities


def decided_by(contraction: float, prior_sensitivity: float, floor: float) -> str:
    """Return what decides a quantity: ``data``, ``prior``, ``both`` (they may be in conflict) or ``unclear``.

    The prior does where its sensitivity is above ArviZ's threshold and above Monte Carlo error; the data do where they
    contracted the prior. Empty where either is not known.
    """
    if np.isnan(contraction) or np.isnan(prior_sensitivity):
        return ""
    data, prior = contraction >= CONTRACTION_LEAST, prior_sensitivity >= max(SENSITIVE, floor)
    return {(True, True): "both", (False, True): "prior", (True, False): "data", (False, False): "unclear"}[data, prior]


def identified(tree: xr.DataTree, name: str) -> pd.DataFrame:
    """Return `MEASURES` and `decided_by` of each element of a quantity, a row each in C order.

    A sensitivity to the likelihood that is not above what Monte Carlo error alone gives is left out. A tree without
    `GROUP`, or a quantity that it does not know, has one row without any.
    """
    if GROUP not in tree.children or name not in tree[GROUP]:
        return pd.DataFrame({**{measure: [np.nan] for measure in MEASURES}, "decided_by": [""]})
    values = tree[GROUP][name].to_numpy().reshape(len(MEASURES), -1)
    table = pd.DataFrame(values.T, columns=list(MEASURES))
    of_prior, of_likelihood = (float(tree[GROUP].attrs[f"{group}_floor"]) for group in ("prior", "likelihood"))
    table["likelihood_sensitivity"] = table["likelihood_sensitivity"].where(lambda values: values > of_likelihood)
    figures = zip(table["contraction"], table["prior_sensitivity"], strict=True)
    return table.assign(decided_by=[decided_by(*pair, of_prior) for pair in figures])


def identify_records(
    tree: xr.DataTree, records: PreparedRecords, model: ModelSettings, attempt: Attempt = directly
) -> xr.DataTree:
    """Return the posterior of a record table with the group `GROUP`: each quantity along the dimension `measure`.

    Parameters
    ----------
    tree, records, model:
        The posterior, the records that it was fitted to, and the model's other settings.
    attempt:
        Runs the power scaling; where that fails, the contraction stands alone.
    """
    data, factors = records.data, records.factors
    draws = max(_PRIOR_DRAWS_LEAST, min(PRIOR_DRAWS, _PRIOR_NUMBERS // len(records.factor_table)))
    without_data = {"data": without_points(data), "likelihood": None, "observed": False}
    drawn = draw_prior(records_model, records.arguments(model) | without_data, PRIOR_SITES, draws, seed=0)
    prior = prior_tree(drawn | usual_repeats(drawn, factors, seed=0), factors, records.factor_table)
    some = thinned(tree["posterior"].to_dataset())
    of_prior = log_prior(some, prior_sites(factors, model.repeats, model.correlation), data, model.priors)
    return with_identifiability(
        tree, prior, of_prior, log_likelihood_of_records(some, records.likelihood), model.priors, attempt
    )


def identify_published(
    tree: xr.DataTree, table: pd.DataFrame, priors: Priors = PRIORS, attempt: Attempt = directly
) -> xr.DataTree:
    """Return the posterior of printed case means with the group that `identify_records` adds.

    Parameters
    ----------
    tree, table:
        The posterior, and the table that `bayes_tyre.inference.sampling.hierarchical_fit.fit_published` took.
    """
    factors = find_factors(table[list(CASE_FACTORS)])
    sites = published_sites(factors)
    printed = {"k": table["k_kN_per_mm"].to_numpy(dtype=float), "beta": table["beta_mm"].to_numpy(dtype=float)}
    arguments = {"values": printed, "factors": factors, "priors": priors}
    drawn = draw_prior(published_model, arguments, PRIOR_SITES, PRIOR_DRAWS, seed=0)
    some = thinned(tree["posterior"].to_dataset())
    densities = log_prior(some, sites, priors=priors), log_likelihood_of_print(some, printed)
    return with_identifiability(
        tree, prior_tree(drawn, factors, pd.DataFrame({"record": []})), *densities, priors, attempt
    )


def prior_tree(drawn: Mapping[str, np.ndarray], factors: Factors, factor_table: pd.DataFrame) -> xr.DataTree:
    """Return draws of the prior, shape (draws, ...) by name, as the tree of one chain."""
    return to_datatree({name: values[None] for name, values in drawn.items()}, {}, factors, factor_table, {})


def thinned(posterior: xr.Dataset) -> xr.Dataset:
    """Return the draws that sensitivities rest on, evenly taken."""
    every = max(1, -(-posterior.sizes["chain"] * posterior.sizes["draw"] // DRAWS))
    return posterior.isel(draw=slice(None, None, every))


def with_identifiability(
    tree: xr.DataTree,
    prior: xr.DataTree,
    log_prior: xr.Dataset,
    log_likelihood: xr.Dataset,
    priors: Priors,
    attempt: Attempt = directly,
) -> xr.DataTree:
    """Return the tree with `GROUP`; a measure that a quantity does not have is NaN.

    A record's own quantities have a contraction alone: at 2 ms each, a thousand sensitivities would cost more than they
    say beyond their case's. Probabilities have none.
    """
    posterior, of_prior = (_quantities(each) for each in (tree, prior))
    of_records = [name for name in posterior.data_vars if "record" in posterior[name].dims]
    above_records = posterior.drop_vars([*of_records, *PROBABILITIES], errors="ignore")
    measures = {"contraction": contraction(posterior, of_prior, priors)}
    measures |= attempt(
        "power scaling",
        lambda: sensitivity(thinned(above_records), log_prior, log_likelihood),
        dict[str, xr.Dataset](),
        kind="sampling",
        remedy="too few different draws have no tail to weigh: raise --warmup and --draws",
    )
    measured = {}
    for name in (str(name) for name in posterior.data_vars):
        like = posterior[name].isel(chain=0, draw=0, drop=True).astype(float)
        each = [
            measures[m][name] if m in measures and name in measures[m] else xr.full_like(like, np.nan) for m in MEASURES
        ]
        values = np.stack([one.transpose(*like.dims).to_numpy() for one in each])
        measured[name] = (("measure", *like.dims), values)
    labels = {name: values for name, values in posterior.coords.items() if name in posterior.dims}
    labels = {name: values for name, values in labels.items() if name not in _SAMPLE}
    floors = {f"{m.split('_')[0]}_floor": measures[m].attrs["floor"] if m in measures else np.nan for m in MEASURES[1:]}
    with_all = tree.copy()
    with_all[GROUP] = xr.DataTree(xr.Dataset(measured, {**labels, "measure": list(MEASURES)}, floors))
    return with_all


def _quantities(tree: xr.DataTree) -> xr.Dataset:
    return tree["posterior"].to_dataset().merge(named_group_means(tree))
