"""The collapsed sampler: NUTS over what records share, on summaries of the records about a pilot run's draws."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

from bayes_tyre.inference.model.collapsed.model import collapsed_records_model
from bayes_tyre.inference.model.collapsed.nearest_summaries import summarise_records
from bayes_tyre.inference.model.collapsed.record_summaries import RecordSummaries, empty_summaries
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, empty_approximation
from bayes_tyre.inference.model.coordinates.reparams import InCoordinates
from bayes_tyre.inference.model.coordinates.sites import record_coordinates, record_starts
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE
from bayes_tyre.inference.sampling.pilot import Location, Pilot
from bayes_tyre.inference.sampling.run import (
    RUNS_AT_MOST,
    Draws,
    SamplerRun,
    SamplerSettings,
    after_runs,
    make_chains,
    run_until_sound,
)
from bayes_tyre.inference.sampling.summary_error import PILOT_ERROR_MOST, SUMMARY_ERROR_MOST, SummaryError

#: Attempts before records are sampled as well, each with summaries made about the draws of the one before: of these
#: there are more than a pilot has.
ATTEMPTS = 2


def collapsed_in_coordinates(approximation: LaplaceApproximation, **arguments: Any) -> None:
    """Run `collapsed_records_model`, with these arguments, in coordinates that follow the Laplace approximation."""
    coordinates = record_coordinates(approximation, arguments["factors"], arguments.get("priors", PRIORS))
    InCoordinates(collapsed_records_model, coordinates)(**arguments)


def sample_collapsed(
    records: PreparedRecords, settings: SamplerSettings, model: ModelSettings
) -> tuple[Draws | None, tuple[SamplerRun, ...], SummaryError]:
    """Return draws of the collapsed sampler, None where the summaries are not good enough; its runs; their error."""
    factors, arguments = records.factors, records.arguments(model)
    count = len(records.batch.records)
    with ThreadPoolExecutor(1) as beside:
        summarising = beside.submit(_summarise, records, model)
        blank = {"summaries": empty_summaries(count, model.correlation), **arguments}
        blank["approximation"] = empty_approximation(count, factors)
        chains = make_chains(collapsed_in_coordinates, blank, settings, record_starts(arguments), CAREFUL_ACCEPTANCE)
        approximation, summaries = summarising.result()
    data, starts = {"approximation": approximation, **arguments}, record_starts(arguments, approximation.records)
    pilot = Pilot(chains, {**data, "summaries": summaries}, starts, settings)
    location, runs = pilot.run(), tuple[SamplerRun, ...]()
    for attempt in range(ATTEMPTS):
        if location.error.at_least > PILOT_ERROR_MOST:
            break
        draws, made, error = _draws_at(pilot, location, after_runs(settings, RUNS_AT_MOST * attempt), attempt)
        runs += tuple(one._replace(sampler="collapsed") for one in made)
        if error.at_least <= SUMMARY_ERROR_MOST:
            return draws, runs, error
        location = location._replace(error=error)
        if attempt + 1 < ATTEMPTS:
            location = pilot.about(location, draws, attempt)
            settings.on_note(f"{_off(error)}: made anew about these draws, for another run")
        del draws  # gigabytes, of many records
    settings.on_note(f"{_off(location.error)}: records are sampled as well")
    return None, runs, location.error


def _draws_at(
    pilot: Pilot, location: Location, settings: SamplerSettings, attempt: int
) -> tuple[Draws, tuple[SamplerRun, ...], SummaryError]:
    """Return draws of chains that begin at a location, their runs, and how far its summaries are off there."""
    chains, begun = pilot.chains_at(location, attempt)
    judged: tuple[Draws, SummaryError] | None = None

    def good_enough(draws: Draws) -> bool:
        nonlocal judged
        if judged is None or judged[0] is not draws:  # slopes of thousands of records take a minute
            judged = draws, pilot.error(location, draws)
        return judged[1].at_least <= SUMMARY_ERROR_MOST

    draws, runs = run_until_sound(chains, settings, good_enough, begun)
    good_enough(draws)  # a second run, where there was one, has not been judged
    assert judged is not None
    return draws, runs, judged[1]


def _off(error: SummaryError) -> str:
    return (
        f"summaries of the records move the log density of what they share by {error.total:.2g} (at most "
        f"{SUMMARY_ERROR_MOST:g}), most in {error.case}"
    )


def _summarise(records: PreparedRecords, model: ModelSettings) -> tuple[LaplaceApproximation, RecordSummaries]:
    approximation = records.approximation(model)
    options = model.correlation, model.priors.discordant_widening
    summaries = summarise_records(records.data, records.normal_likelihood, approximation, records.factors, *options)
    return approximation, summaries
