"""`fit`: all records together, hierarchically."""

import sys
import time
from enum import StrEnum
from typing import Annotated

import typer

from bayes_tyre.cli.lsq import Region
from bayes_tyre.cli.shell import (
    NOT_TRUSTED,
    Chains,
    Draws,
    Interval,
    Out,
    Quiet,
    Records,
    Seed,
    Warmup,
    on_terminal,
    read_records,
    report_verdict,
    say,
)
from bayes_tyre.errors import BadInput


class InitialLoad(StrEnum):
    """What stands for the load in the model of the cases."""

    nominal = "nominal"
    actual = "actual"


def fit(
    records: Records,
    out: Out,
    region: Annotated[Region, typer.Option(help="all points of each record; or the thesis's first 70 %.")] = Region.all,
    initial_load: Annotated[
        InitialLoad,
        typer.Option(
            help="What k and beta may change with: each nominal initial_load_kN, or a slope over the force (kN) that "
            "a case's records really started from."
        ),
    ] = InitialLoad.nominal,
    displacement_scale_sd: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Relative sd of a common, unknown factor on displacement (0.05: a gauge good to 5 %); it widens k and "
            "beta and no ratio of two.",
        ),
    ] = 0.0,
    chains: Chains = 4,
    warmup: Warmup = 600,
    draws: Draws = 1500,
    seed: Seed = 0,
    interval: Interval = 0.95,
    units_checked: Annotated[bool, typer.Option("--units-checked", help="The forces are kN, travel is mm.")] = False,
    quiet: Quiet = False,
) -> None:
    """Fit all records together, hierarchically: posteriors of k, beta, J, C and sigma (kN, mm), none dropped.

    Writes posterior.nc, summary.csv, cases.csv, contrasts.csv, repeats.csv, diagnostics.json, run.json and
    figures/. Ends with code 4 when the diagnostics say that the result is not to be trusted.

    Example: bayes-tyre fit data/campaign/records.csv --out results/fit
    """
    from bayes_tyre.runtime import prepare_jax

    table = read_records(records)
    prepare_jax(chains)
    from bayes_tyre.inference.fit import ModelSettings
    from bayes_tyre.inference.sampling import SamplerSettings
    from bayes_tyre.record_table import origin_of, suspicious_units
    from bayes_tyre.workflow.fit import fit_table

    suspicions = suspicious_units(table)
    if suspicions and not units_checked:
        raise BadInput(f"{records}: {suspicions[0]}; or say --units-checked")
    say(f"fitting {table['record'].nunique()} records (data: {origin_of(table)}), {chains} chains", quiet)
    began = time.monotonic()
    settings = SamplerSettings(chains, warmup, draws, seed, on_terminal(quiet))
    model = ModelSettings(region.value, initial_load.value, displacement_scale_sd)
    diagnostics = fit_table(table, records, out, settings, model, interval, sys.argv[1:])
    say(f"done in {time.monotonic() - began:.0f} s", quiet)
    report_verdict(diagnostics, out, quiet)
    if diagnostics.verdict != "pass":
        raise typer.Exit(NOT_TRUSTED)
