"""The collapsed sampler: NUTS over what records share, on summaries of the records about a pilot run's draws."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from bayes_tyre.inference.model.collapsed.model import collapsed_records_model
from bayes_tyre.inference.model.collapsed.nearest_summaries import refine_summaries, summarise_records
from bayes_tyre.inference.model.collapsed.record_summaries import RecordSummaries, empty_summaries
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, empty_approximation
from bayes_tyre.inference.model.coordinates.reparams import InCoordinates
from bayes_tyre.inference.model.coordinates.sites import record_coordinates, record_starts
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE, CHUNK, Chains
from bayes_tyre.inference.sampling.run import (
    Begun,
    Draws,
    SamplerRun,
    SamplerSettings,
    first_state,
    make_chains,
    run_until_sound,
)
from bayes_tyre.inference.sampling.summary_error import (
    PILOT_ERROR_MOST,
    SUMMARY_ERROR_MOST,
    SummaryError,
    flat,
    summary_error,
)

#: Chunks of the pilot run, at most: after each of these numbers the draws of the last two say where the records'
#: posterior is, and the summaries are made anew about it.
_PILOT_CHUNKS = (3, 2, 2)


def collapsed_in_coordinates(approximation: LaplaceApproximation, **arguments: Any) -> None:
    """Run `collapsed_records_model`, with these arguments, in coordinates that follow the Laplace approximation."""
    coordinates = record_coordinates(approximation, arguments["factors"], arguments.get("priors", PRIORS))
    InCoordinates(collapsed_records_model, coordinates)(**arguments)


def pilot(
    chains: Chains, arguments: Mapping[str, Any], starts: Mapping[str, Any], settings: SamplerSettings
) -> tuple[RecordSummaries, SummaryError, Begun | None]:
    """Return the records' summaries about where a short run of the chains says that they are.

    It is the beginning of the warm-up: the chains go on from where it ends.

    Parameters
    ----------
    chains:
        Of `collapsed_in_coordinates`.
    arguments, starts:
        The model's, with summaries to begin with; and where the chains start.
    settings:
        Seed of the chains, and what to call as they proceed.

    Returns
    -------
    summaries, error, begun:
        The summaries, how far those that they were made from were off, and where the chains are.
    """
    summaries, begun = arguments["summaries"], None
    cases = [case.label for case in arguments["factors"].cases]
    for count in _PILOT_CHUNKS:
        settings.on_stage("pilot run", count * CHUNK)
        chains = chains.given({**arguments, "summaries": summaries}, starts)
        state = first_state(chains, settings.seed, begun)
        chunks = []
        for _ in range(count):
            chunks.append(chains.advance(state, CHUNK))
            state = chunks[-1].state
            settings.on_progress(CHUNK)
        begun = Begun(state, count * CHUNK + (0 if begun is None else begun.iterations))
        # The first chunks of all are on their way to the posterior.
        last = [
            chains.constrain(chunk.unconstrained, (settings.seed, number)) for number, chunk in enumerate(chunks[-2:])
        ]
        sites = {name: np.concatenate([each[name] for each in last], axis=1) for name in last[0]}
        error, summaries = summary_error(sites, chains.sampled, cases), _summaries_about(sites, arguments)
        if not all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves(summaries)):
            # Draws that are all one, of a pilot that stood still, are no posterior to go by.
            error = SummaryError(np.inf, np.inf, cases[0], np.inf)
        if error.total <= SUMMARY_ERROR_MOST or not np.isfinite(error.total):
            break
    return summaries, error, begun


def _summaries_about(sites: Mapping[str, np.ndarray], arguments: Mapping[str, Any]) -> RecordSummaries:
    """Return summaries of the records about draws."""
    of_records = {name: jnp.asarray(flat(sites[name])) for name in ("k", "beta", "sigma", "rho") if name in sites}
    log_values = jnp.log(jnp.stack([of_records["k"], of_records["beta"]], axis=-1))
    noise = [jnp.log(of_records["sigma"]), *([jnp.arctanh(of_records["rho"])] if "rho" in sites else [])]
    factors = arguments["factors"]
    mean_J = jnp.mean(flat(sites["J_group"]), axis=0)[factors.group.of_case[factors.of_record]]
    # The log likelihood of a record is nearly linear in the variance of J.
    of_J = mean_J, jnp.sqrt(jnp.mean(sites["sd_J"] ** 2))
    noise_draws = jnp.stack(noise, axis=-1)
    return refine_summaries(arguments["data"], arguments["likelihood"], log_values, noise_draws, *of_J)


def sample_collapsed(
    records: PreparedRecords, settings: SamplerSettings, model: ModelSettings
) -> tuple[Draws | None, tuple[SamplerRun, ...], SummaryError]:
    """Return draws of the collapsed sampler, None where the summaries are not good enough; its runs; their error."""
    factors, arguments = records.factors, records.arguments(model)
    count, cases = len(records.batch.records), [case.label for case in factors.cases]
    with ThreadPoolExecutor(1) as beside:
        summarising = beside.submit(_summarise, records, model)
        blank = {"summaries": empty_summaries(count, model.correlation), **arguments}
        blank["approximation"] = empty_approximation(count, factors)
        chains = make_chains(collapsed_in_coordinates, blank, settings, record_starts(arguments), CAREFUL_ACCEPTANCE)
        approximation, summaries = summarising.result()
    data, starts = {"approximation": approximation, **arguments}, record_starts(arguments, approximation.records)
    summaries, error, begun = pilot(chains, {**data, "summaries": summaries}, starts, settings)
    runs: tuple[SamplerRun, ...] = ()
    if error.at_least <= PILOT_ERROR_MOST:
        chains = chains.given({**data, "summaries": summaries}, starts)
        errors: list[SummaryError] = []

        def good_enough(draws: Draws) -> bool:
            errors.append(summary_error(draws.sites, chains.sampled, cases))
            return errors[-1].at_least <= SUMMARY_ERROR_MOST

        draws, runs = run_until_sound(chains, settings, good_enough, begun)
        runs = tuple(one._replace(sampler="collapsed") for one in runs)
        error = errors[-1]
        if error.at_least <= SUMMARY_ERROR_MOST:
            return draws, runs, error
    settings.on_note(
        f"summaries of the records move the log density of what they share by {error.total:.2g} (at most "
        f"{SUMMARY_ERROR_MOST:g}), most in {error.case}: records are sampled as well"
    )
    return None, runs, error


def _summarise(records: PreparedRecords, model: ModelSettings) -> tuple[LaplaceApproximation, RecordSummaries]:
    approximation = records.approximation(model)
    options = model.correlation, model.priors.discordant_widening
    summaries = summarise_records(records.data, records.likelihood, approximation, records.factors, *options)
    return approximation, summaries
