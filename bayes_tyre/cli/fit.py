"""`fit`: all records together, hierarchically."""

import sys
import time
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli.lsq import Region
from bayes_tyre.cli.shell import (
    NOT_TRUSTED,
    RECORD_TABLE,
    Chains,
    Draws,
    Interval,
    Out,
    Quiet,
    Resume,
    Seed,
    Warmup,
    note,
    progress,
    read_records,
    report_verdict,
    say,
    warn,
)
from bayes_tyre.errors import BadInput

if TYPE_CHECKING:
    import pandas as pd

    from bayes_tyre.workflow.fit import Plan

#: What may stand beside --from: everything else is in the run.json.
BESIDE_FROM = ("out", "from_run", "resume", "quiet")


class InitialLoad(StrEnum):
    """What stands for the load in the model of the cases."""

    nominal = "nominal"
    actual = "actual"


class LikelihoodKind(StrEnum):
    """How the density of a record's forces is computed."""

    compressed = "compressed"
    direct = "direct"


class Repeats(StrEnum):
    """How the repeats of a case scatter about it."""

    mixture = "mixture"
    student = "student"
    normal = "normal"


class Noise(StrEnum):
    """What the noise of a record is like."""

    iid = "iid"
    ar1 = "ar1"


def fit(
    context: typer.Context,
    out: Out,
    records: Annotated[Path | None, RECORD_TABLE] = None,
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
    likelihood: Annotated[
        LikelihoodKind, typer.Option(help="compressed, whatever the number of points; or direct, point by point.")
    ] = LikelihoodKind.compressed,
    repeats: Annotated[
        Repeats, typer.Option(help="How repeats scatter: usual and discordant ones, Student-t, or normal.")
    ] = Repeats.mixture,
    noise: Annotated[
        Noise, typer.Option(help="Independent from point to point; or ar1: each point's follows the one before.")
    ] = Noise.iid,
    noise_window: Annotated[
        int, typer.Option(min=1, help="Samples of the moving average that went over the noise alone; 1: none.")
    ] = 1,
    chains: Chains = 4,
    warmup: Warmup = 600,
    draws: Draws = 1500,
    seed: Seed = 0,
    interval: Interval = 0.95,
    units_checked: Annotated[bool, typer.Option("--units-checked", help="The forces are kN, travel is mm.")] = False,
    resume: Resume = False,
    from_run: Annotated[
        Path | None,
        typer.Option("--from", metavar="RUN.JSON", help="Repeat the run that wrote this run.json, to the byte."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Fit all records together, hierarchically: posteriors of k, beta, J, C and sigma (kN, mm), none dropped.

    Writes posterior.nc, summary.csv, cases.csv, contrasts.csv, repeats.csv, diagnostics.json, run.json and
    figures/. Ends with code 4 when the diagnostics say that the result is not to be trusted. What was sampled is
    saved on the way in .checkpoint, until the files are written; compiled code is kept in the user's cache folder
    (JAX_COMPILATION_CACHE_DIR says where, JAX_ENABLE_COMPILATION_CACHE=0 switches it off).

    Example: bayes-tyre fit data/campaign/records.csv --out results/fit
    """
    _check_usage(context, records, from_run)
    from bayes_tyre.workflow.fit import (  # imports JAX, which starts only when it computes
        Plan,
        Watch,
        fit_table,
        planned_in,
    )

    if from_run is not None:
        plan = planned_in(from_run, warn)
    else:
        from bayes_tyre.inference.fit import ModelSettings
        from bayes_tyre.inference.sampling import SamplerSettings

        model = ModelSettings(
            *(region.value, initial_load.value, displacement_scale_sd, likelihood.value),
            *(repeats.value, noise.value, noise_window),
        )
        plan = Plan(Path(records or ""), SamplerSettings(chains, warmup, draws, seed), model, interval, units_checked)
    table = _checked_table(plan)
    from bayes_tyre.record_table import origin_of
    from bayes_tyre.runtime import prepare_jax

    sampler = plan.sampler
    prepare_jax(sampler.chains)
    say(f"fitting {table['record'].nunique()} records (data: {origin_of(table)}), {sampler.chains} chains", quiet)
    began = time.monotonic()
    with progress("fit", sampler.warmup + sampler.draws, quiet) as advance:
        watch = Watch(partial(note, quiet=quiet), warn, advance)
        diagnostics = fit_table(table, plan, out, sys.argv[1:], watch, resume=resume)
    say(f"done in {time.monotonic() - began:.0f} s", quiet)
    report_verdict(diagnostics, out, quiet)
    if diagnostics.verdict != "pass":
        raise typer.Exit(NOT_TRUSTED)


def _check_usage(context: typer.Context, records: Path | None, from_run: Path | None) -> None:
    """Refuse neither RECORDS nor --from, and options that --from would contradict."""
    if from_run is None:
        if records is None:
            raise typer.BadParameter("missing; name a record table, or give --from RUN.JSON", param_hint="RECORDS")
        return
    for option in context.command.params:
        source = context.get_parameter_source(str(option.name))
        if option.name not in BESIDE_FROM and source is not None and source.name == "COMMANDLINE":
            name = option.opts[0] if option.opts[0].startswith("-") else "RECORDS"
            raise typer.BadParameter(f"contradicts --from, whose run.json holds it; leave {name} out", param_hint=name)


def _checked_table(plan: "Plan") -> "pd.DataFrame":
    from bayes_tyre.record_table import suspicious_units

    table = read_records(plan.records)
    suspicions = suspicious_units(table)
    if suspicions and not plan.units_checked:
        raise BadInput(f"{plan.records}: {suspicions[0]}; or say --units-checked")
    return table
