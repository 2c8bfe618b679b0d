"""`fit`: all records together, hierarchically."""

import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli.model_options import (
    DisplacementScaleOption,
    InitialLoad,
    InitialLoadOption,
    Likelihood,
    LikelihoodOption,
    Noise,
    NoiseOption,
    NoiseWindowOption,
    PriorsOption,
    Region,
    RegionOption,
    Repeats,
    RepeatsOption,
)
from bayes_tyre.cli.shell import (
    RECORD_TABLE,
    Chains,
    Draws,
    Interval,
    Out,
    Quiet,
    Resume,
    Seed,
    Warmup,
    conclude,
    note,
    progress,
    read_records,
    say,
    warn,
)
from bayes_tyre.errors import BadInput

if TYPE_CHECKING:
    import pandas as pd

    from bayes_tyre.workflow.fit import Plan

#: What may stand beside --from: everything else is in the run.json.
BESIDE_FROM = ("out", "from_run", "resume", "quiet")


def fit(
    context: typer.Context,
    out: Out,
    records: Annotated[Path | None, RECORD_TABLE] = None,
    region: RegionOption = Region.all,
    initial_load: InitialLoadOption = InitialLoad.nominal,
    displacement_scale_sd: DisplacementScaleOption = 0.0,
    likelihood: LikelihoodOption = Likelihood.compressed,
    repeats: RepeatsOption = Repeats.mixture,
    noise: NoiseOption = Noise.iid,
    noise_window: NoiseWindowOption = 1,
    priors: PriorsOption = None,
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
    if from_run is not None:
        from bayes_tyre.workflow.fit import planned_in

        _run(planned_in(from_run, warn), out, resume, quiet)
        return
    from bayes_tyre.inference.sampling.hierarchical_fit import ModelSettings
    from bayes_tyre.inference.sampling.run import SamplerSettings
    from bayes_tyre.workflow.fit import Plan, read_priors

    model = ModelSettings(
        *(region.value, initial_load.value, displacement_scale_sd, likelihood.value),
        *(repeats.value, noise.value, noise_window, read_priors(priors)),
    )
    plan = Plan(Path(records or ""), SamplerSettings(chains, warmup, draws, seed), model, interval, units_checked)
    _run(plan, out, resume, quiet)


def _run(plan: "Plan", out: Path, resume: bool, quiet: bool) -> None:
    """Fit as planned, tell how it goes, and end as the verdict says."""
    from bayes_tyre.record_table import origin_of
    from bayes_tyre.runtime import prepare_jax
    from bayes_tyre.workflow.fit import Callbacks, fit_table  # imports JAX, which starts only when it computes

    table, sampler = _checked_table(plan), plan.sampler
    prepare_jax(sampler.chains)
    say(f"fitting {table['record'].nunique()} records (data: {origin_of(table)}), {sampler.chains} chains", quiet)
    began = time.monotonic()
    with progress("fit", sampler.warmup + sampler.draws, quiet) as advance:
        callbacks = Callbacks(partial(note, quiet=quiet), warn, advance)
        diagnostics = fit_table(table, plan, out, sys.argv[1:], callbacks, resume=resume)
    say(f"done in {time.monotonic() - began:.0f} s", quiet)
    conclude(diagnostics, out, quiet)


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
