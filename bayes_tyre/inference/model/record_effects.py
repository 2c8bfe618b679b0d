"""Records as repeats of cases: their joint density, and the coordinates in which records and cases are sampled.

Where a closed form exists (`marginal_mixture`) the case is integrated out and the choice of discordant repeats is
summed out. The sampler then needs coordinates for the records alone. They are built from an auxiliary value of the
case, given one fixed choice: the repeats that look discordant by their estimates. Given that choice everything is
normal, so weakly identified records follow what their case shares, and no discordant repeat makes a second mode. A
correction factor turns the density under that choice into the density under all choices, and the case itself is drawn
from its conditional.
"""

from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpyro
from jax.scipy.stats import norm
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.case_effects import (
    CaseDistribution,
    Hyperparameters,
    case_distribution,
    deterministic,
    record_cases,
    sample_cases,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates
from bayes_tyre.inference.model.marginal_mixture import (
    ChoicePosterior,
    Members,
    chosen,
    draw_cases,
    find_members,
    marginalise,
    outlier_probability,
)
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.coordinates.reparameterisation import Reparameterised
from bayes_tyre.inference.model.repeat_distribution import add_repeat_density, judgeable

# Samples the records' logarithms, given the mean and the standard deviation of each about its case.
Reparameterise = Callable[[Float[Array, "records parameters"], Float[Array, "records parameters"]], Reparameterised]


def sample_repeats(
    reparameterise: Reparameterise,
    factors: Factors,
    estimates: CaseEstimates,
    repeats: str,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> tuple[Reparameterised, Float[Array, "parameters cases"]]:
    """Sample the logarithms of the records' values and of their cases' values, and add their joint density.

    The density of the change of variables itself (`Reparameterised.log_volume`) is left to the caller.

    Parameters
    ----------
    reparameterise:
        Samples the records' logarithms; called once, records along the first axis of what it returns.
    factors:
        Cases and how they group.
    estimates:
        Estimates of the cases from their records; they shape the coordinates and leave the posterior as it is.
    repeats:
        One of `bayes_tyre.inference.model.repeat_distribution.REPEATS`.
    hyperparameters, parameters:
        Sampled values by name, and the parameters that a case has.
    priors:
        For the widening of discordant repeats and the priors of group means.
    """
    kind = judgeable(repeats, factors)
    members = find_members(factors, kind)
    about = case_distribution(factors, estimates, hyperparameters, parameters, priors)
    widening = priors.discordant_widening
    scale = about.scatter.T[factors.of_record]
    if members is None:
        cases = sample_cases("case", about)
        records = reparameterise(cases.T[factors.of_record], scale)
        add_repeat_density(records.deviation, scale, kind, hyperparameters, widening)
    else:
        case_given_choice = sample_cases("stand_in", about)
        scale = jnp.where(estimates.discordant[:, None], widening, 1.0) * scale
        records = reparameterise(case_given_choice.T[factors.of_record], scale)
        numpyro.factor("repeats", norm.logpdf(records.deviation, 0.0, scale))
        weight = hyperparameters["discordant_weight"]
        offset = case_given_choice - about.mean
        found = marginalise(records.deviation, offset, about.scatter, about.remainder, weight, members, widening)
        _correct_for_other_choices(found, estimates, weight, members)
        deterministic("outlier_probability", outlier_probability(found, members, factors))
        cases = _draw_cases(found, about)
    record_cases(parameters, cases)
    return records, cases


def _correct_for_other_choices(
    found: ChoicePosterior, estimates: CaseEstimates, weight: Array, members: Members
) -> None:
    """Add the log ratio of the density under all choices to that under the one choice that shaped the coordinates."""
    one_choice = chosen(found, estimates.discordant, members)
    prior = jnp.where(estimates.discordant, jnp.log(weight), jnp.log1p(-weight))
    numpyro.factor("other_choices", jnp.sum(prior) - jnp.sum(one_choice))


def _draw_cases(found: ChoicePosterior, about: CaseDistribution) -> Float[Array, "parameters cases"]:
    """Sample the cases from their conditional; a case without a remainder equals its linear predictor."""
    if not about.has_remainder:
        return about.mean
    choosing, z = (
        jnp.asarray(numpyro.sample(name, dist.Normal(0.0, 1.0).expand(shape).to_event()))
        for name, shape in (("choice_z", about.mean.shape[1:]), ("case_z", about.mean.shape))
    )
    return about.mean + draw_cases(found, choosing, z)
