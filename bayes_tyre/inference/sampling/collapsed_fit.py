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
from bayes_tyre.inference.sampling.run import Draws, SamplerRun, SamplerSettings, make_chains, run_until_sound
from bayes_tyre.inference.sampling.summary_error import (
    PILOT_ERROR_MOST,
    SUMMARY_ERROR_MOST,
    SummaryError,
    flat,
    summary_error,
)

#: Chunks of the pilot run: the last one's draws say where the records' posterior is.
_PILOT_CHUNKS = 3
#: Pilot runs at most: of thousands of records, the Laplace approximation's summaries may be too far off for one.
_MOST_PILOTS = 2


def collapsed_in_coordinates(approximation: LaplaceApproximation, **arguments: Any) -> None:
    """Run `collapsed_records_model`, with these arguments, in coordinates that follow the Laplace approximation."""
    coordinates = record_coordinates(approximation, arguments["factors"], arguments.get("priors", PRIORS))
    InCoordinates(collapsed_records_model, coordinates)(**arguments)


def pilot(
    chains: Chains, arguments: Mapping[str, Any], settings: SamplerSettings
) -> tuple[RecordSummaries, SummaryError]:
    """Return the records' summaries about where a short run of the chains says that they are, and their error in it.

    Parameters
    ----------
    chains:
        Of `collapsed_in_coordinates`.
    arguments:
        The model's.
    settings:
        Seed of the chains, and what to call as they proceed.
    """
    cases = [case.label for case in arguments["factors"].cases]
    settings.on_stage("pilot run", _PILOT_CHUNKS * CHUNK)
    state = chains.begin(settings.seed)
    for _ in range(_PILOT_CHUNKS):
        chunk = chains.advance(state, CHUNK)
        state = chunk.state
        settings.on_progress(CHUNK)
    sites = chains.constrain(chunk.unconstrained, (settings.seed,))
    of_records = {name: jnp.asarray(flat(sites[name])) for name in ("k", "beta", "sigma", "rho") if name in sites}
    log_values = jnp.log(jnp.stack([of_records["k"], of_records["beta"]], axis=-1))
    noise = [jnp.log(of_records["sigma"]), *([jnp.arctanh(of_records["rho"])] if "rho" in sites else [])]
    known = arguments["data"], arguments["likelihood"], arguments["summaries"]
    mean_J = jnp.mean(flat(sites["J_group"]), axis=0)[
        arguments["factors"].group.of_case[arguments["factors"].of_record]
    ]
    refined = refine_summaries(*known, log_values, jnp.stack(noise, axis=-1), mean_J, jnp.mean(sites["sd_J"]))
    # Draws that are all one, of a pilot that stood still, are no posterior to go by.
    sound = all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves(refined))
    error = summary_error(sites, chains.sampled, cases) if sound else SummaryError(np.inf, np.inf, cases[0], np.inf)
    return refined, error


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
    known, starts = {"approximation": approximation, **arguments}, record_starts(arguments, approximation.records)
    for _ in range(_MOST_PILOTS):
        rough = {**known, "summaries": summaries}
        summaries, error = pilot(chains.given(rough, starts), rough, settings)
        if error.at_least <= PILOT_ERROR_MOST or not np.isfinite(error.at_least):
            break
    runs: tuple[SamplerRun, ...] = ()
    if error.at_least <= PILOT_ERROR_MOST:
        chains = chains.given({**known, "summaries": summaries}, starts)
        errors: list[SummaryError] = []

        def good_enough(draws: Draws) -> bool:
            errors.append(summary_error(draws.sites, chains.sampled, cases))
            return errors[-1].at_least <= SUMMARY_ERROR_MOST

        draws, runs = run_until_sound(chains, settings, good_enough)
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
