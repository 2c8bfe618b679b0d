"""Records about their cases: how both are placed, and how the records scatter as repeats of one case.

A case's value is integrated out and its odd repeats are summed out (`summed_out`) where that can be done. In its place
stands the value that the case would have if just those repeats were discordant that look it. Given that choice all is
normal: records that by themselves say little are placed about what they share, and no odd repeat makes two modes. The
density is then put right from that one choice to all of them, and the case itself is drawn beside.
"""

from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpyro
from jax.scipy.stats import norm
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.case_effects import (
    AboutWords,
    Hyperparameters,
    about_words,
    keep,
    keep_cases,
    sample_cases,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.laplace_cases import CaseEstimates
from bayes_tyre.inference.model.marginal_mixture import (
    Members,
    SummedOut,
    chosen,
    draw_cases,
    find_members,
    outlier_probability,
    sum_out,
)
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.reparameterisation import Placed
from bayes_tyre.inference.model.repeat_distribution import judgeable, repeats_about_cases

# What places the records' logarithms, given the level that each lies about and its standard deviation there.
Place = Callable[[Float[Array, "records parameters"], Float[Array, "records parameters"]], Placed]


def records_about_cases(
    place: Place,
    factors: Factors,
    estimates: CaseEstimates,
    repeats: str,
    hyperparameters: Hyperparameters,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> tuple[Placed, Float[Array, "parameters cases"]]:
    """Return the logarithms of the records' values and of their cases', with the density of all but the placing.

    Parameters
    ----------
    place:
        Called once; what it returns has the records along its first axis.
    factors:
        Cases and how they group.
    estimates:
        What the records say of their cases; it shapes the coordinates and leaves the posterior as it is.
    repeats:
        One of `bayes_tyre.inference.model.repeat_distribution.REPEATS`.
    populations, parameters:
        What was sampled of the priors, and of which parameters cases and records are.
    """
    kind = judgeable(repeats, factors)
    members = find_members(factors, kind)
    about = about_words(factors, estimates, hyperparameters, parameters, priors)
    widening = priors.discordant_widening
    scale = about.scatter.T[factors.of_record]
    if members is None:
        cases = sample_cases("case", about)
        records = place(cases.T[factors.of_record], scale)
        repeats_about_cases(records.deviation, scale, kind, hyperparameters, widening)
    else:
        stand_in = sample_cases("stand_in", about)
        scale = jnp.where(estimates.discordant[:, None], widening, 1.0) * scale
        records = place(stand_in.T[factors.of_record], scale)
        numpyro.factor("repeats", norm.logpdf(records.deviation, 0.0, scale))
        weight = hyperparameters["discordant_weight"]
        offset = stand_in - about.factor_table
        found = sum_out(records.deviation, offset, about.scatter, about.remainder, weight, members, widening)
        _put_right(found, estimates, weight, members)
        keep("outlier_probability", outlier_probability(found, members, factors))
        cases = _drawn(found, about)
    keep_cases(parameters, cases)
    return records, cases


def _put_right(found: SummedOut, estimates: CaseEstimates, weight: Array, members: Members) -> None:
    """Add what the density of all choices together is above that of the one that the stand-ins were sampled with."""
    one_choice = chosen(found, estimates.discordant, members)
    prior = jnp.where(estimates.discordant, jnp.log(weight), jnp.log1p(-weight))
    numpyro.factor("other_choices", jnp.sum(prior) - jnp.sum(one_choice))


def _drawn(found: SummedOut, about: AboutWords) -> Float[Array, "parameters cases"]:
    """Sample the cases themselves; one without a remainder is what its words predict."""
    if not about.has_remainder:
        return about.factor_table
    choosing, z = (
        jnp.asarray(numpyro.sample(name, dist.Normal(0.0, 1.0).expand(shape).to_event()))
        for name, shape in (("choice_z", about.factor_table.shape[1:]), ("case_z", about.factor_table.shape))
    )
    return about.factor_table + draw_cases(found, choosing, z)
