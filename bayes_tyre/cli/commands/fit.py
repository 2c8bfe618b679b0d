"""`fit`: all records together, hierarchically."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from bayes_tyre.cli import model_options, sampled, shell
from bayes_tyre.errors import BadInput
from bayes_tyre.runtime import finds_gpu, prepare_jax

if TYPE_CHECKING:
    import pandas as pd

    from bayes_tyre.workflow.fit import Plan

#: Options that may be combined with --from; all others are read from the run.json.
BESIDE_FROM = ("out", "from_run", "resume", "xlsx", "device", "quiet", "verbose", "log_file")

#: Fewest draws of a record that may be kept: of fewer, the ends of a 95 % interval are the outermost draws.
STORED_DRAWS_LEAST = 40


def fit(
    context: typer.Context,
    out: shell.Out,
    records: Annotated[list[Path] | None, shell.RECORD_TABLE] = None,
    columns: shell.ColumnsMap = None,
    law: model_options.LawOption = "equation_2",
    region: model_options.RegionOption = "all",
    initial_load: model_options.InitialLoadOption = "nominal",
    displacement_scale_sd: model_options.DisplacementScaleOption = None,
    force_scale_sd: model_options.ForceScaleOption = None,
    displacement_sd: model_options.DisplacementSdOption = None,
    likelihood: model_options.LikelihoodOption = "compressed",
    repeats: model_options.RepeatsOption = "mixture",
    noise: model_options.NoiseOption = "auto",
    noise_window: model_options.NoiseWindowOption = 1,
    specimen: model_options.SpecimenOption = None,
    day: model_options.DayOption = None,
    covariate: model_options.CovariateOption = None,
    priors: model_options.PriorsOption = None,
    chains: shell.Chains = 4,
    warmup: shell.Warmup = 600,
    draws: shell.Draws = None,
    target_accept: shell.TargetAccept = None,
    sampler: model_options.SamplerOption = "collapsed",
    seed: shell.Seed = 0,
    interval: shell.Interval = 0.95,
    limit: shell.LimitOption = None,
    reference: shell.ReferenceOption = None,
    record_draws: Annotated[
        int | None,
        typer.Option(
            min=STORED_DRAWS_LEAST,
            help="Draws of each record to keep in posterior.nc, over all chains; what records share is kept in full, "
            "and tables are of all draws. At least 40: curves have intervals. Default: all; 200 of more than 2,000 "
            "records.",
            show_default=False,
        ),
    ] = None,
    units_checked: Annotated[
        bool,
        typer.Option(
            "--units-checked", help="Accept units that look wrong: forces are in kN, displacements are in mm."
        ),
    ] = False,
    xlsx: shell.Xlsx = False,
    resume: shell.Resume = False,
    from_run: Annotated[
        Path | None,
        typer.Option("--from", metavar="RUN.JSON", help="Repeat the run that wrote this run.json, to the byte."),
    ] = None,
    device: Annotated[
        Literal["cpu", "gpu"] | None,
        typer.Option(help="What to compute on; default: a GPU where JAX finds one.", show_default=False),
    ] = None,
    quiet: shell.Quiet = False,
) -> None:
    """Fit all records together, hierarchically: posteriors of k, beta, J, C and sigma (kN, mm). No record is dropped.

    Prints the answer, then writes posterior.nc, summary.csv, cases.csv, contrasts.csv, repeats.csv (with --xlsx
    results.xlsx too, a sheet for each), diagnostics.json, run.json and figures/. Ends with code 4 when the diagnostics
    say that the result is not to be trusted. What was sampled is saved on the way in .checkpoint, until the files are
    written; compiled code is kept in the user's cache folder (JAX_COMPILATION_CACHE_DIR says where,
    JAX_ENABLE_COMPILATION_CACHE=0 switches it off).

    Example: bayes-tyre fit data/campaign/records.csv --out results/fit
    """
    began = time.monotonic()
    _check_usage(context, records, from_run)
    if from_run is not None:
        from bayes_tyre.workflow.fit import planned_in

        plan = planned_in(from_run, shell.warn)
        _run(plan, _checked_table(plan), out, resume, xlsx, device, quiet, began)
        return
    from bayes_tyre.inference.model.settings import ModelSettings
    from bayes_tyre.results.limits import OF_RECORDS
    from bayes_tyre.workflow.fit import Plan, read_priors

    model = ModelSettings(
        region=region,
        initial_load=initial_load,
        displacement_scale_sd=displacement_scale_sd,
        force_scale_sd=force_scale_sd,
        displacement_sd=displacement_sd,
        likelihood=likelihood,
        repeats=repeats,
        noise=noise,
        noise_window=noise_window,
        priors=read_priors(priors),
        sampler=sampler,
        law=law,
        specimen=specimen,
        day=day,
        covariates=tuple(covariate or ()),
    )
    settings = sampled.settings(chains, warmup, draws, seed, target_accept)
    limit = shell.checked_limit(limit, OF_RECORDS)
    plan = Plan(tuple(records or ()), settings, model, interval, units_checked, columns, limit, reference, record_draws)
    table = _checked_table(plan)
    _run(plan.for_records(table["record"].nunique()), table, out, resume, xlsx, device, quiet, began)


def _run(
    plan: "Plan",
    table: "pd.DataFrame",
    out: Path,
    resume: bool,
    xlsx: bool,
    device: str | None,
    quiet: bool,
    began: float,
) -> None:
    """Fit as planned, print progress and answer; exit with code 4 unless the verdict is pass."""
    from bayes_tyre.record_table import origin_of
    from bayes_tyre.workflow.fit import fit_table  # imports JAX, which starts only when it computes

    prepare_jax(plan.sampler.chains, device)
    if device == "gpu" and not finds_gpu():
        raise BadInput(
            "--device gpu: JAX finds none here; install its plugin for the GPU (such as jax[cuda13]), unset "
            "JAX_PLATFORMS, or leave the option out"
        )
    origin = origin_of(table)
    shell.say(f"fitting {table['record'].nunique()} records (data: {origin}), {plan.sampler.chains} chains", quiet)
    sampled.fitted(
        lambda callbacks: fit_table(table, plan, out, sys.argv[1:], callbacks, resume=resume, xlsx=xlsx),
        out=out,
        origin=origin,
        options={"reference": plan.reference},
        quiet=quiet,
        limited=plan.limit is not None,
        began=began,
    )


def _check_usage(context: typer.Context, records: list[Path] | None, from_run: Path | None) -> None:
    """Raise a usage error if both RECORDS and --from are missing, or if an option contradicts --from."""
    if from_run is None:
        if not records:
            raise typer.BadParameter("missing; name a record table, or give --from RUN.JSON", param_hint="RECORDS")
        return
    if name := shell.given_beside(context, BESIDE_FROM):
        raise typer.BadParameter(f"contradicts --from, whose run.json holds it; leave {name} out", param_hint=name)


def _checked_table(plan: "Plan") -> "pd.DataFrame":
    result = shell.read_records(plan.records, plan.columns)
    if result.suspicions and not plan.units_checked:
        raise BadInput(f"{result.suspicions[0]}, or name the unit in a column map (--columns); or say --units-checked")
    return result.table
