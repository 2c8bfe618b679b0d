"""The model of records with every record, case and choice integrated out: what NUTS walks over is what they share.

It is `bayes_tyre.inference.model.models.records_model` with the density of each record replaced by its summary. Records
are drawn afterwards, given each draw, and their own density has the last word on them.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpyro
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.collapsed.record_summaries import RecordSummaries, record_log_density
from bayes_tyre.inference.model.collapsed.repeats import collapse_repeats, sample_cases_of
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import (
    PARAMETERS,
    Hyperparameters,
    deterministic,
    prior_sites,
    sample_hyperparameters,
    standard_normals,
)
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.likelihood.force_distribution import RecordForces
from bayes_tyre.inference.model.marginal_mixture import picked
from bayes_tyre.inference.model.models import sample_mean_J, sample_offsets
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.record_data import EQUATION_2, RecordData

#: Values of each record drawn from its summary, of which its density picks one.
_PROPOSALS = 4
#: Site with the logarithm of what the summaries miss of the density of each case's records, by draw.
SUMMARY_ERROR = "summary_error"


def collapsed_records_model(
    data: RecordData,
    factors: Factors,
    likelihood: Likelihood,
    summaries: RecordSummaries,
    *,
    repeats: str = "mixture",
    noise: str = "iid",
    law: str = EQUATION_2,
    priors: Priors = PRIORS,
) -> None:
    """Model the summaries of all records (NumPyro model; sites as those of `records_model`).

    Parameters
    ----------
    data, factors, likelihood, repeats, noise, law, priors:
        As `records_model` has them.
    summaries:
        Of the records.
    """
    hyperparameters = sample_hyperparameters(prior_sites(factors, repeats, noise), priors)
    typical, sd_of_noise = _sample_noise(hyperparameters, len(factors.of_record), noise, priors)
    of_noise, interaction, noise_given = summaries.noise.log_marginal(typical, sd_of_noise)
    values, constant = summaries.values.given(typical + noise_given.draw(jnp.zeros_like(typical.T)).T)
    mean_J, sd_J = sample_mean_J(factors, priors), hyperparameters["sd_J"]
    values, of_offsets = summaries.offsets.move(values, mean_J, sd_J), summaries.offsets.at(mean_J, sd_J)
    collapsed = collapse_repeats(values, factors, repeats, hyperparameters, priors=priors)
    numpyro.factor("log_density_of_noise", of_noise + constant)
    numpyro.factor("log_density_of_offsets", of_offsets)
    proposal = ProposalNormals.sample(factors, typical.shape[1])
    if proposal is None:  # a density, not a draw, is wanted
        return

    log_values = collapsed.draw(proposal.of_choice, proposal.of_cases, proposal.of_records)
    z = proposal.of_noise
    noises = typical + jnp.moveaxis(jax.vmap(jax.vmap(noise_given.draw))(jnp.stack([z, -z])), 2, -1)
    density = partial(record_log_density, data, likelihood, mean_J=mean_J, sd_J=sd_J)
    exact = jax.vmap(jax.vmap(density))(log_values, noises)
    missed = exact - values.at(log_values) - constant - summaries.noise.at(noises) - of_offsets - interaction
    # The logarithm of a mean of so few would miss part of their variance: its first two cumulants do not.
    gained = jnp.mean(missed, axis=(0, 1)) + 0.5 * jnp.mean(jnp.var(missed, axis=1, ddof=1), axis=0)
    by_case = jnp.zeros(len(factors.cases)).at[factors.of_record].add(gained)
    deterministic(SUMMARY_ERROR, by_case)
    # One side alone: repeats of a case are drawn about one and the same.
    chosen = picked(jax.nn.log_softmax(missed[0], axis=0), proposal.of_pick)[None, :, None]
    log_values, noises = (jnp.take_along_axis(each[0], chosen, axis=0)[0] for each in (log_values, noises))

    sample_cases_of(collapsed, log_values, factors)
    sigma, rho = deterministic("sigma", jnp.exp(noises[:, 0])), None
    if noise == "ar1":
        rho = deterministic("rho", jnp.tanh(noises[:, 1]))
    sample_offsets(RecordForces(data, log_values, mean_J, sd_J, sigma, rho, likelihood, law), data.F)


class ProposalNormals(NamedTuple):
    """Standard normals by which a draw of what is shared gets proposals of its records.

    Attributes
    ----------
    of_choice, of_cases:
        One for each case, for its choice of discordant repeats; and one for each of its parameters.
    of_records, of_noise:
        For the values and the noise of each record, in each of `_PROPOSALS` proposals.
    of_pick:
        For which of these a record takes.
    """

    of_choice: Float[Array, " cases"]
    of_cases: Float[Array, "parameters cases"]
    of_records: Float[Array, "proposals parameters records"]
    of_noise: Float[Array, "proposals q records"]
    of_pick: Float[Array, " records"]

    @classmethod
    def sample(cls, factors: Factors, q: int) -> "ProposalNormals | None":
        """Return them, or None where a density is wanted, not a draw."""
        cases, records = len(factors.cases), len(factors.of_record)
        shapes = {
            "of_choice": (cases,),
            "of_cases": (len(PARAMETERS), cases),
            "of_records": (_PROPOSALS, len(PARAMETERS), records),
            "of_noise": (_PROPOSALS, q, records),
            "of_pick": (records,),
        }
        normals = {name: standard_normals(f"proposal_{name}", shape) for name, shape in shapes.items()}
        given = {name: z for name, z in normals.items() if z is not None}
        return cls(**given) if given else None


def _sample_noise(
    hyperparameters: Hyperparameters, records: int, noise: str, priors: Priors
) -> tuple[Float[Array, "records q"], Float[Array, "records q"]]:
    """Sample the typical values of the noise's parameters; return them for each record, and the sd about them."""
    names = {"log_sigma": priors["sigma_typical"]}
    if noise == "ar1":
        names["atanh_rho"] = priors["atanh_rho_typical"]
    typical = [
        jnp.asarray(numpyro.sample(f"{name}_typical", dist.Normal(*prior.parameters))) for name, prior in names.items()
    ]
    deterministic("sigma_typical", jnp.exp(typical[0]))
    # A record by itself has the typical value.
    sd = [hyperparameters.get(f"sd_{name}", jnp.zeros(())) for name in names]
    shape = records, len(names)
    return jnp.broadcast_to(jnp.stack(typical), shape), jnp.broadcast_to(jnp.stack(sd), shape)
