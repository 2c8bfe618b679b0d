"""Records as repeats of their cases: the logarithms of the values of both."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
import numpyro
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.case_effects import CaseDistribution, sample_case_distribution, with_remainder
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, Hyperparameters, deterministic, deterministic_each
from bayes_tyre.inference.model.marginal_mixture import (
    ChoicePosterior,
    RepeatsOfCases,
    apart_probability,
    draw_cases,
    find_members,
    outlier_probability,
)
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.repeat_distribution import MixtureAbout, NormalAbout, judgeable, repeats_about_cases


def sample_records(
    factors: Factors,
    repeats: str,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> tuple[Float[Array, "records parameters"], Float[Array, "parameters cases"]]:
    """Sample the logarithms of the records' values and of their cases' values.

    Where a closed form exists the case is integrated out, and the choice of discordant repeats and whether the case
    stands apart are summed out (`RepeatsOfCases`); the case is then drawn from its conditional.

    Parameters
    ----------
    factors:
        Cases and how they group.
    repeats:
        One of `bayes_tyre.inference.model.repeat_distribution.REPEATS`.
    hyperparameters, parameters:
        Sampled values by name, and the parameters that a case has.
    priors:
        For the constants of the mixtures and the priors of group means.
    """
    kind, rest = judgeable(repeats, factors), with_remainder(factors, parameters)
    about, widening = sample_case_distribution(factors, hyperparameters, parameters, priors), priors.discordant_widening
    members = find_members(factors, kind, apart=about.apart_weight > 0)
    if members is None:
        cases = _sample_cases(about, parameters, rest)
        of_records = cases.T[factors.of_record] + about.offset, about.sd_repeat.T[factors.of_record]
        fn = repeats_about_cases(kind, *of_records, hyperparameters, widening)
        records = jnp.asarray(numpyro.sample("log_records", fn))
        if isinstance(fn, MixtureAbout):
            deterministic("outlier_probability", fn.probability(records))
    else:
        weight = hyperparameters.get("discordant_weight", jnp.zeros(()))
        fn = RepeatsOfCases(about, weight, widening, factors.of_record, members)
        records = jnp.asarray(numpyro.sample("log_records", fn))
        posterior = fn.given(records)
        if members.choices.any():
            deterministic("outlier_probability", outlier_probability(posterior, members, factors))
        cases = sample_cases_given(posterior, about, parameters, rest)
    deterministic_each("*_case", parameters, jnp.exp(cases))
    return records, cases


def _sample_cases(
    about: CaseDistribution, parameters: Sequence[str], rest: np.ndarray
) -> Float[Array, "parameters cases"]:
    """Sample the cases: the linear predictor, plus a remainder for those parameters that have one."""
    if not len(rest):
        return about.mean
    mean = about.mean[rest]
    # Whether a case stands apart is each parameter's own question: each is a unit by itself.
    centre, sd = mean.reshape(-1, 1), jnp.broadcast_to(about.remainder[rest], mean.shape).reshape(-1, 1)
    weight = jnp.asarray(about.apart_weight)
    fn = MixtureAbout(centre, sd, weight, about.apart_widening) if about.apart_weight else NormalAbout(centre, sd)
    cases = jnp.asarray(numpyro.sample("log_cases", fn))
    if isinstance(fn, MixtureAbout):
        _keep_apart_probability(fn.probability(cases).reshape(mean.shape), parameters, rest)
    return about.mean.at[rest].set(cases.reshape(mean.shape))


def _keep_apart_probability(
    probability: Float[Array, "rest cases"], parameters: Sequence[str], rest: np.ndarray
) -> None:
    deterministic_each("*_apart_probability", [str(parameters[index]) for index in rest], probability)


def sample_cases_given(
    posterior: ChoicePosterior, about: CaseDistribution, parameters: Sequence[str], rest: np.ndarray
) -> Float[Array, "parameters cases"]:
    """Sample the cases given the values of their repeats; `rest`: which parameters have a remainder."""
    if not len(rest):
        return about.mean
    if about.apart_weight:
        _keep_apart_probability(apart_probability(posterior)[rest], parameters, rest)
    every = about.mean.shape
    of_choice, of_kind, z = (
        jnp.asarray(numpyro.sample(name, dist.Normal(0.0, 1.0).expand(shape).to_event()))
        for name, shape in (("choice_z", every[1:]), ("kind_z", every), ("case_z", every))
    )
    return about.mean + draw_cases(posterior, of_choice, of_kind, z)
