"""The NumPyro model of records that are motions: their estimates, repeats in a case, cases by what their words say."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import numpyro
import pandas as pd
import xarray as xr
from jaxtyping import Array, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.cases import case_level, flat
from bayes_tyre.inference.coordinates import Gaussian, place_jointly
from bayes_tyre.inference.levels import Levels, find_levels
from bayes_tyre.inference.picture import CaseEstimates, case_estimates
from bayes_tyre.inference.populations import MOTION_PARAMETERS, motion_sites, population_starts, sample_populations
from bayes_tyre.inference.posterior import to_datatree
from bayes_tyre.inference.priors import prior_medians
from bayes_tyre.inference.repeats import REPEATS, judgeable, repeats_about_cases
from bayes_tyre.inference.sampling import SamplerSettings, sample


@dataclass(frozen=True)
class Motions:
    """The records' estimates as the model takes them, arrays in the order of `MOTION_PARAMETERS`.

    Attributes
    ----------
    words:
        A row a record: `record` and the words.
    rows, target:
        Shape (records, 5, 5) and (records, 5): the likelihood of a record's logarithms is
        exp(-|rows @ logarithms - target|^2 / 2); `bayes_tyre.inference.motion_likelihood`.
    log_mean, log_variance:
        Shape (records, 5): the records' estimates with their own priors. They shape the sampler's coordinates only.
    """

    words: pd.DataFrame
    rows: Float[np.ndarray, "records 5 5"]
    target: Float[np.ndarray, "records 5"]
    log_mean: Float[np.ndarray, "records 5"]
    log_variance: Float[np.ndarray, "records 5"]


def log_likelihood(
    logarithms: Float[Array, "*draws records 5"],
    rows: Float[Array, "records 5 5"],
    target: Float[Array, "records 5"],
) -> Float[Array, "*draws records"]:
    """Return the log likelihood of each record's logarithms, but for a constant."""
    return -0.5 * jnp.sum((jnp.einsum("rij,...rj->...ri", rows, logarithms) - target) ** 2, axis=-1)


def motions_model(
    rows: Float[Array, "records 5 5"],
    target: Float[Array, "records 5"],
    cases: CaseEstimates,
    levels: Levels,
    *,
    repeats: str = "mixture",
) -> None:
    """Model the estimates of all records (NumPyro model; sites in kN, mm, kg, kN s/mm; scales are relative).

    Parameters
    ----------
    rows, target:
        As `Motions` has them.
    cases:
        What the records say of their cases; it shapes the coordinates and leaves the posterior as it is.
    levels:
        Cases and how they group.
    repeats:
        One of `bayes_tyre.inference.repeats.REPEATS`.
    """
    populations = sample_populations(motion_sites(levels, repeats))
    case, by_case = case_level(levels, cases, populations, MOTION_PARAMETERS)
    _keep_with_x("_case", jnp.exp(case))
    above, scale = case.T[levels.of_record], by_case.T[levels.of_record]
    # Whitened by its rows an estimate is of five independent numbers, each a mixture of the logarithms: coordinates
    # follow the scatter of repeats where a record says little, and the record where it says much.
    placed = place_jointly(flat("records_z", above.shape), rows, Gaussian(target, jnp.ones_like(target)), above, scale)
    numpyro.factor("records_volume", placed.log_volume)
    numpyro.factor("estimates", log_likelihood(placed.value, rows, target))
    repeats_about_cases(placed.deviation, scale, judgeable(repeats, levels), populations)
    values = jnp.exp(placed.value).T
    for name, value in zip(MOTION_PARAMETERS, values, strict=True):
        numpyro.deterministic(name, value)
    _keep_with_x("", values)


def _keep_with_x(ending: str, values: Float[Array, "5 units"]) -> None:
    """Keep x, kN, of records or cases, which follows from x - k beta, k and beta."""
    k, settled, beta, *_ = values
    numpyro.deterministic(f"x{ending}", settled + k * beta)


def fit_motions(motions: Motions, settings: SamplerSettings | None = None, repeats: str = "mixture") -> xr.DataTree:
    """Return the posterior of k, x, beta, m and c of every record, their cases and populations.

    Parameters
    ----------
    motions:
        The records' estimates.
    settings:
        How much to sample.
    repeats:
        How repeats scatter about their case.

    Returns
    -------
    xarray.DataTree
        As `bayes_tyre.inference.fit.fit_hierarchical` gives it, its attribute `model` ``motion``.

    Raises
    ------
    BadInput
        For an unknown kind of repeats.
    """
    if repeats not in REPEATS:
        raise BadInput(f"repeats {repeats!r} is unknown; use {' or '.join(REPEATS)}")
    levels = find_levels(motions.words)
    arguments = {
        **{"rows": jnp.asarray(motions.rows), "target": jnp.asarray(motions.target), "levels": levels},
        **{"cases": case_estimates(motions.log_mean, motions.log_variance, levels), "repeats": repeats},
    }
    starts = population_starts(motion_sites(levels, repeats), prior_medians())
    draws = sample(motions_model, arguments, settings or SamplerSettings(), starts)
    attributes = {"model": "motion", "repeats": repeats}
    return to_datatree(draws.sites, draws.statistics, levels, motions.words, attributes)
