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
    draw_cases,
    find_members,
    outlier_probability,
)
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.repeat_distribution import MixtureRepeats, judgeable, repeats_about_cases


def sample_records(
    factors: Factors,
    repeats: str,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> tuple[Float[Array, "records parameters"], Float[Array, "parameters cases"]]:
    """Sample the logarithms of the records' values and of their cases' values.

    Where a closed form exists the case is integrated out and the choice of discordant repeats is summed out
    (`RepeatsOfCases`), and the case is then drawn from its conditional.

    Parameters
    ----------
    factors:
        Cases and how they group.
    repeats:
        One of `bayes_tyre.inference.model.repeat_distribution.REPEATS`.
    hyperparameters, parameters:
        Sampled values by name, and the parameters that a case has.
    priors:
        For the widening of discordant repeats and the priors of group means.
    """
    kind, rest = judgeable(repeats, factors), with_remainder(factors, parameters)
    about, widening = sample_case_distribution(factors, hyperparameters, parameters, priors), priors.discordant_widening
    members = find_members(factors, kind)
    if members is None:
        cases = _sample_cases(about, rest)
        of_records = cases.T[factors.of_record], about.scatter.T[factors.of_record]
        fn = repeats_about_cases(kind, *of_records, hyperparameters, widening)
        records = jnp.asarray(numpyro.sample("log_records", fn))
        if isinstance(fn, MixtureRepeats):
            deterministic("outlier_probability", fn.discordant(records))
    else:
        fn = RepeatsOfCases(*about, hyperparameters["discordant_weight"], widening, factors.of_record, members)
        records = jnp.asarray(numpyro.sample("log_records", fn))
        posterior = fn.given(records)
        deterministic("outlier_probability", outlier_probability(posterior, members, factors))
        cases = sample_cases_given(posterior, about) if len(rest) else about.mean
    deterministic_each("*_case", parameters, jnp.exp(cases))
    return records, cases


def _sample_cases(about: CaseDistribution, rest: np.ndarray) -> Float[Array, "parameters cases"]:
    """Sample the cases: the linear predictor, plus a remainder for those parameters that have one."""
    if not len(rest):
        return about.mean
    fn = dist.Normal(about.mean[rest], jnp.broadcast_to(about.remainder[rest], about.mean[rest].shape))
    return about.mean.at[rest].set(jnp.asarray(numpyro.sample("log_cases", fn.to_event(2))))


def sample_cases_given(posterior: ChoicePosterior, about: CaseDistribution) -> Float[Array, "parameters cases"]:
    """Sample the cases given the values of their repeats."""
    choosing, z = (
        jnp.asarray(numpyro.sample(name, dist.Normal(0.0, 1.0).expand(shape).to_event()))
        for name, shape in (("choice_z", about.mean.shape[1:]), ("case_z", about.mean.shape))
    )
    return about.mean + draw_cases(posterior, choosing, z)
