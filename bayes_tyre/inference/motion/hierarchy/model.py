"""The NumPyro model of records that are motions: their estimates, repeats in a case, cases by their factors."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import numpyro
import pandas as pd
import xarray as xr
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates, case_estimates
from bayes_tyre.inference.model.coordinates.reparameterisation import Reparameterised, reparameterise_whitened
from bayes_tyre.inference.model.coordinates.reparams import InCoordinates
from bayes_tyre.inference.model.coordinates.sites import case_coordinates, hyperparameter_starts
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import deterministic_each, motion_sites, sample_hyperparameters
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_effects import sample_records
from bayes_tyre.inference.model.repeat_distribution import REPEATS
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.inference.sampling.datatree import to_datatree
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE
from bayes_tyre.inference.sampling.run import RUNS, SamplerSettings, make_chains, run_until_sound, runs_to_json


class Readings(NamedTuple):
    """What records' readings are worth beyond the shape of their likelihoods, shape (records,) each.

    Attributes
    ----------
    log_constant:
        Makes exp(-|rows @ logarithms - target|^2 / 2) the density of the readings (`evidence.log_constant`).
    effective_draws:
        That the estimate and its evidence rest on.
    """

    log_constant: Float[np.ndarray, " records"]
    effective_draws: Float[np.ndarray, " records"]


@dataclass(frozen=True)
class Motions:
    """The records' estimates as the model takes them, arrays in the order of the law's `parameters`.

    Attributes
    ----------
    factor_table:
        A row a record: `record` and the factors.
    rows, target:
        Shape (records, p, p) and (records, p): the likelihood of a record's logarithms is
        exp(-|rows @ logarithms - target|^2 / 2); `bayes_tyre.inference.motion.record.likelihood`.
    log_mean, log_variance:
        Shape (records, p): the records' estimates with their own priors. They shape the sampler's coordinates only.
    law:
        That the records were fitted with.
    readings:
        What comparing laws needs of the records' readings; None where nobody kept it.
    """

    factor_table: pd.DataFrame
    rows: Float[np.ndarray, "records p p"]
    target: Float[np.ndarray, "records p"]
    log_mean: Float[np.ndarray, "records p"]
    log_variance: Float[np.ndarray, "records p"]
    law: MotionLaw = FANCHER
    readings: Readings | None = None


def log_likelihood(
    logarithms: Float[Array, "*draws records p"], rows: Float[Array, "records p p"], target: Float[Array, "records p"]
) -> Float[Array, "*draws records"]:
    """Return the log likelihood of each record's logarithms, but for a constant."""
    return -0.5 * jnp.sum((jnp.einsum("rij,...rj->...ri", rows, logarithms) - target) ** 2, axis=-1)


def motions_model(
    rows: Float[Array, "records p p"],
    target: Float[Array, "records p"] | None,
    factors: Factors,
    *,
    repeats: str = "mixture",
    law: MotionLaw = FANCHER,
    priors: Priors = PRIORS,
) -> None:
    """Model the estimates of all records (NumPyro model; sites in kN, mm, kg, kN s/mm; scales are relative).

    Parameters
    ----------
    rows, target:
        As `Motions` has them; without a target it is drawn, for a prior predictive.
    factors:
        Cases and how they group.
    repeats:
        One of `bayes_tyre.inference.model.repeat_distribution.REPEATS`.
    law:
        Whose parameters the estimates are of.
    """
    hyperparameters = sample_hyperparameters(motion_sites(factors, repeats, law.parameters), priors)
    records, cases = sample_records(factors, repeats, hyperparameters, law.parameters, priors)
    _deterministic_with_x("_case", jnp.exp(cases), law)
    numpyro.sample("readings", dist.Normal(jnp.einsum("rij,rj->ri", rows, records), 1.0), obs=target)
    values = jnp.exp(records).T
    deterministic_each("*", law.parameters, values)
    _deterministic_with_x("", values, law)


def motions_in_coordinates(cases: CaseEstimates, **arguments: Any) -> None:
    """Run `motions_model`, with these arguments, in coordinates that follow the records' estimates."""

    def reparameterised(z: Array, case: Array, sd_repeat: Array) -> Reparameterised:
        # Whitened by its rows an estimate is of independent numbers, each a mixture of the logarithms: coordinates
        # follow the scatter of repeats where a record says little, and the record where it says much.
        return reparameterise_whitened(z, arguments["rows"], arguments["target"], case, sd_repeat)

    factors, law, priors = (arguments[name] for name in ("factors", "law", "priors"))
    coordinates = case_coordinates(factors, cases, lambda _: reparameterised, law.parameters, priors)
    InCoordinates(motions_model, coordinates)(**arguments)


def _deterministic_with_x(ending: str, values: Float[Array, "p units"], law: MotionLaw) -> None:
    """Keep x, kN, of records or cases where the law has it: it follows from x - k beta, k and beta."""
    if "x" not in law.reported:
        return
    k, settled, beta, *_ = values
    numpyro.deterministic(f"x{ending}", settled + k * beta)


def motion_arguments(
    motions: Motions, repeats: str, factors: Factors, priors: Priors
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the arguments of `motions_in_coordinates`, and where the hyperparameters start."""
    parameters = motions.law.parameters
    cases = case_estimates(motions.log_mean, motions.log_variance, factors, priors, parameters)
    arguments = {
        **{"rows": jnp.asarray(motions.rows), "target": jnp.asarray(motions.target), "factors": factors},
        **{"cases": cases, "repeats": repeats},
        **{"law": motions.law, "priors": priors},
    }
    starts = hyperparameter_starts(motion_sites(factors, repeats, parameters), priors.medians(), priors)
    return arguments, starts


def fit_motions(
    motions: Motions,
    settings: SamplerSettings | None = None,
    repeats: str = "mixture",
    factors: Factors | None = None,
    priors: Priors = PRIORS,
) -> xr.DataTree:
    """Return the posterior of the law's parameters, m and c of every record, their cases and populations.

    Parameters
    ----------
    motions:
        The records' estimates.
    settings:
        How much to sample.
    repeats:
        How repeats scatter about their case.
    factors:
        Of the factors; None: those of the records, only with cases that have records.

    Returns
    -------
    xarray.DataTree
        As `bayes_tyre.inference.sampling.hierarchical_fit.fit_hierarchical` gives it, its attribute `model` ``motion``.

    Raises
    ------
    BadInput
        For an unknown kind of repeats.
    """
    if repeats not in REPEATS:
        raise BadInput(f"repeats {repeats!r} is unknown; use {' or '.join(REPEATS)}")
    factors = factors or find_factors(motions.factor_table)
    arguments, starts = motion_arguments(motions, repeats, factors, priors)
    settings = settings or SamplerSettings()
    chains = make_chains(motions_in_coordinates, arguments, settings, starts, CAREFUL_ACCEPTANCE)
    draws, runs = run_until_sound(chains, settings)
    attributes = {"model": "motion", "repeats": repeats, "law": motions.law.name, "priors": priors.to_json()}
    attributes[RUNS] = runs_to_json(runs)
    return to_datatree(draws.sites, draws.statistics, factors, motions.factor_table, attributes)
