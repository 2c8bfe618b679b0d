"""The NumPyro models: records, repeats in a case, cases by configuration, direction, speed, load and step.

Two models share the level of the cases: `records_model` takes force against displacement, `published_model` takes
case means such as Tables 9 and 11 alone. They are programs to be run forwards (`numpyro.infer.Predictive`) and
backwards; the coordinates in which they are sampled stand in `coordinates`.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpyro
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.case_effects import sample_linear_predictor, sample_sd_by_speed, sd_about_cases
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import (
    PARAMETERS,
    Hyperparameters,
    deterministic,
    deterministic_each,
    prior_sites,
    published_sites,
    sample_hyperparameters,
)
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.likelihood.force_distribution import RecordForces
from bayes_tyre.inference.model.likelihood.offsets import sd_of_offsets, start_of
from bayes_tyre.inference.model.likelihood.student import StudentForces, StudentLikelihood
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.inference.model.record_effects import sample_records
from bayes_tyre.inference.record_data import EQUATION_2, RecordData


def records_model(
    data: RecordData,
    factors: Factors,
    likelihood: Likelihood | StudentLikelihood | None = None,
    *,
    repeats: str = "mixture",
    noise: str = "iid",
    law: str = EQUATION_2,
    priors: Priors = PRIORS,
    observed: bool = True,
) -> None:
    """Model the forces of all records (NumPyro model; sites in kN, mm; standard deviations of k and beta are relative).

    Parameters
    ----------
    data:
        The records as measured: where each starts, its displacement and its force.
    factors:
        Cases and how they group.
    likelihood:
        Of the records' forces, where a quicker one than point by point is to serve; that of ``student`` noise is none.
    repeats:
        One of `REPEATS`; with fewer than `JUDGEABLE_REPEATS` repeats a case, always ``normal``.
    noise:
        ``iid``; ``ar1``, which samples a lag-1 autocorrelation rho for each record; or ``student``, whose tails are
        those of a Student-t: F_i and J are then sampled with the rest.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`; a likelihood that is given must be of it.
    priors:
        Of the hyperparameters.
    observed:
        False draws the forces, for a prior predictive; `data.F` is then not looked at.
    """
    records = len(factors.of_record)
    hyperparameters = sample_hyperparameters(prior_sites(factors, repeats, noise), priors)
    mean_J = sample_mean_J(factors, priors)
    log_values, _ = sample_records(factors, repeats, hyperparameters, priors=priors)
    rho = None
    if noise == "ar1":
        atanh_rho, _ = _of_records("atanh_rho", priors["atanh_rho_typical"], records, hyperparameters)
        rho = deterministic("rho", jnp.tanh(atanh_rho))
    log_sigma, typical = _of_records("log_sigma", priors["sigma_typical"], records, hyperparameters)
    deterministic("sigma_typical", jnp.exp(typical))
    sigma = deterministic("sigma", jnp.exp(log_sigma))
    if noise == "student":
        theta = jnp.concatenate([sample_start(data, mean_J, hyperparameters["sd_J"]), log_values], axis=1)
        _keep_record(data, theta)
        fn = StudentForces(data, theta, sigma, hyperparameters["noise_nu"], law)
        numpyro.sample("force", fn, obs=data.F if observed else None)
        return
    assert not isinstance(likelihood, StudentLikelihood)
    fn = RecordForces(data, log_values, mean_J, hyperparameters["sd_J"], sigma, rho, likelihood, law)
    force = numpyro.sample("force", fn, obs=data.F if observed else None)
    sample_offsets(fn, jnp.asarray(force))


def sample_mean_J(factors: Factors, priors: Priors) -> Float[Array, " records"]:
    """Sample the mean of J (kN) of each configuration and direction, and return that of each record."""
    prior = dist.Normal(*priors["J_group"].parameters).expand((len(factors.group.labels),)).to_event(1)
    return jnp.asarray(numpyro.sample("J_group", prior))[factors.group.of_case[factors.of_record]]


def sample_offsets(fn: RecordForces, force: Float[Array, "records points"]) -> None:
    """Sample F_i and J of each record given its forces (kN), and keep what a record is known by."""
    z = numpyro.sample("offsets_z", dist.Normal(0.0, 1.0).expand(fn.log_values.shape).to_event())
    start = fn.start(fn.given(force).draw(jnp.asarray(z)))
    _keep_record(fn.data, jnp.concatenate([start, fn.log_values], axis=1))


def sample_start(
    data: RecordData, mean_J: Float[Array, " records"], sd_J: Float[Array, ""]
) -> Float[Array, "records 2"]:
    """Sample F_i and J (kN) of each record, which its forces do not determine in closed form."""
    offsets = numpyro.sample("offsets_of_records", dist.Normal(0.0, sd_of_offsets(data, sd_J)).to_event(2))
    return start_of(data, mean_J, jnp.asarray(offsets))


def _keep_record(data: RecordData, theta: Float[Array, "records 4"]) -> None:
    F_i, J, (k, beta) = theta[:, 0], theta[:, 1], jnp.exp(theta[:, 2:]).T
    for name, value in {"k": k, "beta": beta, "J": J, "F_i": F_i, "C": F_i + J - k * data.d_0}.items():
        numpyro.deterministic(name, value)


def _of_records(
    name: str, prior: Prior, records: int, hyperparameters: Hyperparameters
) -> tuple[Float[Array, " records"], Float[Array, ""]]:
    """Sample a noise parameter of each record, normal about a typical value, and return both.

    A record by itself has the typical value.
    """
    typical = jnp.asarray(numpyro.sample(f"{name}_typical", dist.Normal(*prior.parameters)))
    if records == 1:
        return typical[None], typical
    about_typical = dist.Normal(typical, hyperparameters[f"sd_{name}"]).expand((records,)).to_event(1)
    return jnp.asarray(numpyro.sample(f"{name}_records", about_typical)), typical


def published_model(
    values: Mapping[str, Float[ArrayLike, " cases"]] | None, factors: Factors, priors: Priors = PRIORS
) -> None:
    """Model printed case means, one a case, such as Tables 9 and 11.

    One value a case cannot tell the scatter of repeats from the case's remainder: both are one term, a Student-t whose
    width differs by speed, partially pooled, so that a few means far off move little. `k_case`, `beta_case` are the
    typical (median) values of cases with these factors; a t has no mean of what it is the logarithm of. The ratio of
    two configurations is the same in all cases of a direction, a speed and an initial load.

    Parameters
    ----------
    values:
        ``k`` (kN/mm) and ``beta`` (mm) by case; None draws them, for a prior predictive.
    factors:
        How the cases group.
    priors:
        Of the hyperparameters.

    Source: of the errors, Gelman et al. (2013), Bayesian Data Analysis, section 17.2.
    """
    hyperparameters = sample_hyperparameters(published_sites(factors), priors)
    by_speed = sample_sd_by_speed(factors, hyperparameters, of="published")
    mean = sample_linear_predictor(factors, hyperparameters, priors=priors)
    sd_published = sd_about_cases(factors, {**hyperparameters, **by_speed}, of="published")
    deterministic_each("*_case", PARAMETERS, jnp.exp(mean))
    fn = dist.StudentT(hyperparameters["student_nu"], mean, sd_published)
    numpyro.sample("log_published", fn, obs=None if values is None else log_published(values))


def log_published(values: Mapping[str, Float[ArrayLike, " cases"]]) -> Float[Array, "parameters cases"]:
    """Return the logarithms of printed case means, in the order of `PARAMETERS`."""
    return jnp.log(jnp.stack([jnp.asarray(values[parameter]) for parameter in PARAMETERS]))
