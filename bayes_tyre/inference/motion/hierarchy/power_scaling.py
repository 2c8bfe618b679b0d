"""Sensitivity of each quantity of the motions' hierarchy to its prior and to the data, by power scaling."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.diagnostics.log_densities import SAMPLE, log_prior, without_labels
from bayes_tyre.inference.diagnostics.power_scaling import (
    PRIOR_DRAWS,
    PRIOR_SITES,
    prior_tree,
    thinned,
    with_identifiability,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import motion_sites
from bayes_tyre.inference.model.prior_predictive import draw_prior, usual_repeats
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.motion.hierarchy.model import Motions, log_likelihood, motions_model
from bayes_tyre.inference.sampling.common_scales import as_measured


def log_likelihood_of_motions(posterior: xr.Dataset, motions: Motions) -> xr.Dataset:
    """Return the log density of each record's readings at each draw but for a constant: `motion`, dims ..., record.

    Parameters
    ----------
    posterior, motions:
        Draws of `bayes_tyre.inference.motion.hierarchy.model.fit_motions`, or of `common_scales.with_scale`; and data.
    """
    posterior = as_measured(posterior)
    values = [posterior[name].transpose(*SAMPLE, "record").to_numpy() for name in motions.law.parameters]
    rows, target = jnp.asarray(motions.rows), jnp.asarray(motions.target)
    density = log_likelihood(jnp.log(jnp.stack(values, axis=-1)), rows, target)
    template = posterior["k"].transpose(*SAMPLE, "record")
    return without_labels({"motion": template.copy(data=np.asarray(density))})


def identify_motions(
    tree: xr.DataTree, motions: Motions, priors: Priors = PRIORS, attempt: Attempt = directly
) -> xr.DataTree:
    """Return the posterior of motions with the group that `identify_records` adds.

    Parameters
    ----------
    tree, motions:
        The posterior, and the data of `bayes_tyre.inference.motion.hierarchy.model.fit_motions`.
    attempt:
        As `identify_records` takes it.
    """
    factors = find_factors(motions.factor_table)
    law = motions.law
    sites = motion_sites(factors, tree.attrs["repeats"], law.parameters)
    arguments = {"rows": jnp.asarray(motions.rows), "target": jnp.asarray(motions.target), "factors": factors}
    arguments |= {"repeats": tree.attrs["repeats"], "law": law, "priors": priors}
    prior = draw_prior(motions_model, arguments, PRIOR_SITES, PRIOR_DRAWS, seed=0)
    prior |= usual_repeats(prior, factors, 0, law.parameters)
    if "x" in law.reported:
        prior["x"] = prior["settled"] + prior["k"] * prior["beta"]
    draws = thinned(tree["posterior"].to_dataset())
    densities = log_prior(draws, sites, priors=priors), log_likelihood_of_motions(draws, motions)
    return with_identifiability(tree, prior_tree(prior, factors, motions.factor_table), *densities, priors, attempt)
