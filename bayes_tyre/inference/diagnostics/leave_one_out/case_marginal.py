"""The marginal density of all records of a case given the hyperparameters: its own k and beta are integrated out too.

It says how well a model predicts a case that was not tested. In closed form where the log likelihood of each record is
quadratic in log k and log beta; by importance sampling of case, records and noise about that closed form as it is.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float

from bayes_tyre.inference.diagnostics.leave_one_out.record_marginal import (
    RecordDensity,
    RecordPopulation,
    forces_at,
    hyperparameters,
    log_prior_of_noise,
    log_standard,
    noise_about,
    student_points,
    unknowns,
)
from bayes_tyre.inference.model.case_effects import CaseDistribution
from bayes_tyre.inference.model.collapsed.repeats import CollapsedRepeats
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, apart_weight
from bayes_tyre.inference.model.marginal_mixture import members_of
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import draws_in_a_row, sd_repeat_of_cases

#: Points of each integral.
POINTS = 128


class CasePopulation(NamedTuple):
    """What cases are drawn from, a draw of the posterior each; standard deviations are relative.

    Attributes
    ----------
    mean:
        Linear predictor of the logarithms of k (kN/mm) and beta (mm).
    remainder, sd_repeat:
        Standard deviation of cases about it, and of repeats about their case.
    offset:
        What specimen, day and covariates add to each record.
    """

    mean: Float[Array, "*draws parameters cases"]
    remainder: Float[Array, "*draws parameters 1"]
    sd_repeat: Float[Array, "*draws parameters cases"]
    offset: Float[Array, "*draws records parameters"]


def case_population(posterior: xr.Dataset, factors: Factors) -> CasePopulation:
    """Return what the cases of a posterior are drawn from.

    Parameters
    ----------
    posterior:
        Dims chain, draw, ...; for displacement as it was measured.
    factors:
        Of the records; the posterior was fitted with the same cases and levels.
    """
    means, remainders, sds, offsets = [], [], [], []
    draws = posterior.sizes["chain"] * posterior.sizes["draw"]
    for parameter in PARAMETERS:
        mean = np.log(draws_in_a_row(posterior[f"{parameter}_group"]))[:, factors.group.of_case]
        for name, factor in factors.effects(parameter).items():
            # A posterior holds no levels whose effect is zero by construction (`to_datatree`).
            effects = np.zeros((draws, len(factor.labels)))
            effects[:, factor.free] = draws_in_a_row(posterior[f"log_{parameter}_{name}"])
            mean = mean + effects[:, factor.of_case] * factor.weight
        sd = f"sd_log_{parameter}_case"
        of_case = draws_in_a_row(posterior[sd]) if sd in posterior else np.zeros(draws)
        offset = np.zeros((draws, len(factors.of_record)))
        if factors.levels.names:
            effects = {name: draws_in_a_row(posterior[f"log_{parameter}_{name}"]) for name in factors.levels.names}
            offset = factors.levels.offset(effects.__getitem__)
        means.append(mean)
        remainders.append(of_case[:, None])
        sds.append(sd_repeat_of_cases(posterior, parameter, factors))
        offsets.append(offset)
    mean, remainder, sd_repeat = (jnp.asarray(np.stack(each, axis=1)) for each in (means, remainders, sds))
    return CasePopulation(mean, remainder, sd_repeat, jnp.asarray(np.stack(offsets, axis=2)))


def densities_of_cases(posterior: xr.Dataset, records: PreparedRecords, model: ModelSettings) -> RecordDensity:
    """Return the density of the records of each case under a posterior's hyperparameters; shape (draws, cases).

    Parameters
    ----------
    posterior:
        For displacement as it was measured; of a model that can be collapsed
        (`bayes_tyre.inference.model.collapsed.repeats.can_collapse`).
    records, model:
        The records, and the model's settings.
    """
    factors, priors = records.factors, model.priors
    estimates = estimate_records(records.batch, model.correlation, records.whitening, law=model.law)
    mixed = "discordant_weight" in posterior
    members = members_of(factors, discordant=mixed)
    weight_apart = apart_weight(factors, PARAMETERS, priors)
    cases, count = len(factors.cases), len(factors.of_record)
    random = np.random.default_rng(0)
    of_choice, of_cases, of_records = (
        jnp.asarray(random.standard_normal((POINTS, *shape)))
        for shape in ((cases,), (len(PARAMETERS), cases), (len(PARAMETERS), count))
    )
    z = student_points(random, (POINTS, unknowns(model.correlation) - len(PARAMETERS), count))
    log_z = log_standard(jnp.moveaxis(z, 1, -1))

    def given(of_draw: tuple[RecordPopulation, CasePopulation]) -> RecordDensity:
        of, population = of_draw
        mean, remainder, sd_repeat, offset = population
        about = CaseDistribution(mean, remainder, sd_repeat, weight_apart, priors.apart_widening, offset)
        quadratic = estimates.of_log_values(of.mean_J, of.sd_J)
        weight = jnp.zeros(()) if of.discordant_weight is None else of.discordant_weight
        repeats = CollapsedRepeats(about, quadratic, weight, priors.discordant_widening, factors.of_record, members)
        collapsed = repeats.given()

        def drawn(of_choice: Array, of_cases: Array, of_records: Array) -> Array:
            return collapsed.draw(of_choice, of_cases, of_records[None])[0, 0]

        log_values = jax.vmap(drawn)(of_choice, of_cases, of_records)
        log_sigma, atanh_rho, narrow = noise_about(z, estimates, of)
        forces = forces_at(records.likelihood, records.data, of, log_values, log_sigma, atanh_rho, z[:, 1:])
        of_noise = log_prior_of_noise(log_sigma, atanh_rho, of) + narrow - log_z
        by_record = forces + of_noise - quadratic.at(log_values)
        by_case = jnp.zeros((POINTS, cases)).at[:, factors.of_record].add(by_record)
        total = logsumexp(by_case, axis=0)
        effective = jnp.exp(2.0 * total - logsumexp(2.0 * by_case, axis=0))
        return RecordDensity(collapsed.log_density + total - jnp.log(POINTS), effective)

    populations = hyperparameters(posterior, factors), case_population(posterior, factors)
    return jax.jit(lambda of: jax.lax.map(given, of))(populations)
