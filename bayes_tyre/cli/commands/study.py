"""`study`: validation of the posterior on simulated data."""

from collections.abc import Collection
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from bayes_tyre.cli.messages import fault
from bayes_tyre.cli.model_options import FancherLaw
from bayes_tyre.cli.raw import Workers
from bayes_tyre.cli.shell import NOT_TRUSTED, Out, Quiet, Seed, first_paragraph, guarded, progress, say, warn
from bayes_tyre.runtime import prepare_jax

if TYPE_CHECKING:
    from bayes_tyre.studies.calibration import Calibration

Resume = Annotated[
    bool, typer.Option("--resume", help="Fit only data sets that earlier runs into --out have not fitted.")
]
#: Host devices among which data sets are divided.
DEVICES = 2
#: Data sets of a calibration unless asked otherwise; and of one around a fit, each of twice its records.
DATASETS, DATASETS_AROUND = 500, 100

study = typer.Typer(
    name="study",
    help="Validate the posterior on simulated data of known k (kN/mm) and beta (mm).",
    no_args_is_help=True,
    rich_markup_mode=None,
)


class RankedLaw(StrEnum):  # Typer takes no list of Literal
    """Force laws that are told apart by what they predict."""

    fancher = "fancher"
    kelvin_voigt = "kelvin_voigt"
    bouc_wen = "bouc_wen"
    maxwell_slip = "maxwell_slip"
    rigid_ring = "rigid_ring"


def calibration(
    out: Out,
    datasets: Annotated[
        int | None,
        typer.Option(
            min=20, help="Simulated data sets, each fitted. Default: 500; with --around 100.", show_default=False
        ),
    ] = None,
    around: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder that fit wrote: calibrate around its records. New records of the same tests are simulated "
            "with true values drawn from its posterior, and fitted together with its own. With 24 records of 40 points "
            "a data set takes 2 to 3 s on two cores, 100 of them 5 minutes.",
        ),
    ] = None,
    model: Annotated[
        Literal["records", "published", "motion"] | None,
        typer.Option(
            help="What is calibrated: the model of records, that of the printed case means (of published --posterior), "
            "or the hierarchy of motions. Default: records.",
            show_default=False,
        ),
    ] = None,
    noise: Annotated[
        Literal["iid", "ar1", "student"] | None,
        typer.Option(
            help="Noise of the records, simulated and fitted: independent (iid), autoregressive (ar1), or with heavy "
            "tails (student). Default: iid; with --around that of the fit.",
            show_default=False,
        ),
    ] = None,
    repeats: Annotated[
        int | None, typer.Option(min=1, max=8, help="Repeats of each case. Default: 3.", show_default=False)
    ] = None,
    weak: Annotated[
        bool, typer.Option("--weak", help="Weak records: 10 points instead of 40, and noise of about 0.3 kN.")
    ] = False,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Rank true values (k kN/mm, beta mm, J kN, ...) among the draws of their posteriors.

    They are drawn from the priors; or with --around from a posterior, for the sampler on data like one's own. Writes
    calibration.csv (coverage of 50, 80 and 95 % intervals, p-value of uniform ranks), outlier_calibration.csv (how many
    records with about the same outlier_probability were discordant), ranks.csv, datasets.csv, priors.csv and figures/.
    Exit code 4 where a parameter is not calibrated.

    Example: bayes-tyre study calibration --out results/calibration --datasets 500
    """
    given = {"--model": model, "--noise": noise, "--repeats": repeats, "--weak": weak or None}
    _check_calibrated(model, around, [name for name, value in given.items() if value is not None])
    prepare_jax(DEVICES)
    from bayes_tyre.workflow.from_results.calibration_around import read_around, write_calibration_around
    from bayes_tyre.workflow.studies import CalibrationTarget, write_calibration

    if around is None:
        sets, what = datasets or DATASETS, CalibrationTarget(model or "records", noise or "iid", repeats or 3, weak)
        with progress("calibrating", sets, quiet) as on_progress:
            result = write_calibration(out, sets, seed, on_progress, what)
    else:
        sets = datasets or DATASETS_AROUND
        fitted = read_around(around, sets, warn)
        with progress(f"calibrating around {around}", sets, quiet) as on_progress:
            result = write_calibration_around(out, fitted, sets, seed, on_progress)
    _say_calibration(result, out, quiet)


def _check_calibrated(model: str | None, around: Path | None, given: list[str]) -> None:
    """Refuse options that what is calibrated does not have."""
    if around is not None and given:
        raise typer.BadParameter("contradicts --around, whose fit says it; leave it out", param_hint=given[0])
    without = {"published": ("--noise", "--repeats", "--weak"), "motion": ("--noise", "--weak")}.get(model or "", ())
    if refused := next((name for name in given if name in without), None):
        raise typer.BadParameter(f"is of records, not of --model {model}; leave it out", param_hint=refused)


def _say_calibration(result: "Calibration", out: Path, quiet: bool) -> None:
    """Print how many parameters are calibrated, and end with code 4 unless all are."""
    failed = result.datasets["sampling"] != "ok"
    say(f"wrote {out / 'calibration.csv'} (simulated, not measured)", quiet)
    say(f"  sampling failed in {failed.sum()} of {len(failed)} data sets; they are included", quiet)
    uncalibrated = result.table.loc[~result.table["calibrated"], "parameter"]
    say(f"  calibrated: {len(result.table) - len(uncalibrated)} of {len(result.table)} parameters", quiet)
    if not result.outliers.empty:
        right, ranges = result.outliers["inside"].sum(), len(result.outliers)
        say(f"  outlier_probability: as many discordant records as predicted in {right} of {ranges} ranges", quiet)
    for name in uncalibrated:
        fault(f"{name}: ranks of truths are not uniform; see {out / 'figures' / 'calibration.png'}")
    if len(uncalibrated):
        raise typer.Exit(NOT_TRUSTED)


def outliers(
    out: Out,
    campaigns: Annotated[
        int, typer.Option(min=4, help="Simulated campaigns with each share of discordant repeats.")
    ] = 200,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Compare the posterior with the source's rule for discordant repeats, and with the plain mean (k kN/mm, beta mm).

    Writes outliers.csv (relative error, coverage of 95 % intervals), datasets.csv and figures/.

    Example: bayes-tyre study outliers --out results/outliers --campaigns 200
    """
    prepare_jax(DEVICES)
    from bayes_tyre.studies.outliers import SHARES, overview_lines
    from bayes_tyre.workflow.studies import write_outliers

    with progress("fitting campaigns", len(SHARES) * campaigns, quiet) as on_progress:
        result = write_outliers(out, campaigns, seed, on_progress)
    failed = result.datasets["sampling"] != "ok"
    say(f"wrote {out / 'outliers.csv'} (simulated, not measured)", quiet)
    say(f"  sampling failed in {failed.sum()} of {len(failed)} campaigns; they are included", quiet)
    for line in overview_lines(result.table):
        say(f"  {line}", quiet)


def motion(
    out: Out,
    stationary: Annotated[int, typer.Option(min=0, help="Stationary records of known truth.")] = 12,
    rolling: Annotated[int, typer.Option(min=0, help="Rolling records of known truth, 15 to 35 km/h.")] = 12,
    mismatch: Annotated[
        int,
        typer.Option(
            min=0,
            help="This many further records of each kind with each mismatch: shapes and ringing of the load, lag of "
            "laser and load cell, mass on the load cell, beam mode, relaxation, other friction, growing stiffness, "
            "mass, three together; rolling ones with another speed or road too.",
        ),
    ] = 0,
    standing_only: Annotated[
        bool,
        typer.Option(
            "--standing-only",
            help="Mismatches of stationary records alone: rolling ones take 17 to 80 s of processor time each (with "
            "--law auto longer).",
        ),
    ] = False,
    law: Annotated[
        FancherLaw,
        typer.Option(help="Force law of the fit, Fancher's or one that extends it; auto averages over all of them."),
    ] = "fancher",
    kinds: Annotated[
        str,
        typer.Option(
            help="Mismatches, such as 'relaxing branch,mass 5 % off'; all without it. A wrong name lists them."
        ),
    ] = "",
    seed: Seed = 0,
    workers: Workers = None,
    resume: Resume = False,
    quiet: Quiet = False,
) -> None:
    """Fit motions of known k (kN/mm), x (kN), beta (mm), m (kg), c (kN s/mm): error, bias, coverage, mismatch.

    Writes motion_records.csv (a row a record and parameter: truth, estimate, standard deviation, 95 % interval, Pareto
    k, seconds, status) and motion_study.csv (errors in %, coverage with its interval, number of failed records).

    Example: bayes-tyre study motion --out results/motion_study --rolling 24 --mismatch 2
    """
    if stationary + rolling + mismatch == 0:
        raise typer.BadParameter("no record is asked for: --stationary, --rolling or --mismatch must be above 0")
    if not mismatch and (kinds or standing_only):
        option = "--kinds" if kinds else "--standing-only"
        raise typer.BadParameter("has no effect without --mismatch; say how many records of each", param_hint=option)
    prepare_jax()
    from bayes_tyre.studies.motion_study import MISMATCHED, MotionFit, sentences, study_records
    from bayes_tyre.workflow.execution.batch import Machines
    from bayes_tyre.workflow.studies import write_motion_study

    names = _names(kinds, MISMATCHED)
    records = study_records(stationary, rolling, seed, mismatch, standing_only, names)
    if not records:
        raise typer.BadParameter("name mismatches of rolling records alone", param_hint="--kinds with --standing-only")
    options = {"stationary": stationary, "rolling": rolling, "mismatch": mismatch, "standing_only": standing_only}
    with progress("fitting motions", len(records), quiet) as on_progress:
        machines, fit = Machines(workers, None, resume), MotionFit(seed, law)
        result = write_motion_study(out, records, fit, on_progress, machines, options | {"kinds": names})
    say(f"wrote {out / 'motion_study.csv'} (simulated, not measured)", quiet)
    for line in sentences(result.table):
        say(f"  {line}", quiet)


def laws(
    out: Out,
    law: Annotated[
        list[RankedLaw] | None, typer.Option(help="Law to simulate with; may be given again. Every one by default.")
    ] = None,
    records: Annotated[
        int, typer.Option(min=2, max=6, help="Standing records of each law, steps of 10 kN up and down in turn.")
    ] = 4,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Rank the force laws (k kN/mm, friction kN, beta mm, ...) on records simulated with each of them, as compare does.

    Every law is fitted to the records of each, and ranked by what it predicts of a record left out. Writes
    law_ranking.csv (a row a true and a fitted law: rank, log density, difference to the first and its standard error)
    and law_ranking_records.csv (a row a record: log density, evidence, misfit of its acceleration, status). Exit code 4
    where neither the true law nor one that contains it comes first within two standard errors.

    Example: bayes-tyre study laws --out results/law_ranking --records 4
    """
    prepare_jax(DEVICES)
    from bayes_tyre.studies.law_ranking import RANKED_LAWS, ranked_correctly, sentences
    from bayes_tyre.workflow.studies import write_law_ranking

    names = list(dict.fromkeys(one.value for one in law)) if law else list(RANKED_LAWS)
    with progress("ranking laws", len(names) * len(RANKED_LAWS), quiet) as on_progress:
        result = write_law_ranking(out, names, records, seed, on_progress)
    say(f"wrote {out / 'law_ranking.csv'} (simulated, not measured)", quiet)
    for line in sentences(result.table):
        say(f"  {line}", quiet)
    if not ranked_correctly(result.table).all():
        raise typer.Exit(NOT_TRUSTED)


def coverage(
    out: Out,
    kinds: Annotated[
        str, typer.Option(help="Kinds of data, such as clean,few_points; all without it. A wrong name lists them.")
    ] = "",
    sets: Annotated[int, typer.Option(min=1, help="Simulated data sets of each kind, each fitted.")] = 40,
    seed: Seed = 0,
    resume: Resume = False,
    quiet: Quiet = False,
) -> None:
    """Count how often intervals of k (kN/mm) and beta (mm) hold the truth, on records as modelled and with a fault.

    Fits data sets of 24 records (48 of case_apart and of the kinds untested_...) with the defaults of fit: 15 to 30 s
    each on two cores, weak records some minutes; all kinds with 40 sets each take many hours.
    Writes coverage.csv (50 and 95 % intervals, of all data sets and of those whose verdict is pass), verdicts.csv
    (failed checks by kind), coverage_estimates.csv (a row a record or case, with its truth) and figures/.

    Example: bayes-tyre study coverage --out results/coverage --kinds clean,correlated_noise --sets 10
    """
    from bayes_tyre.studies.coverage_data import KINDS

    names = _names(kinds, KINDS)
    prepare_jax(DEVICES)
    from bayes_tyre.studies.coverage import overview
    from bayes_tyre.workflow.studies import write_coverage

    with progress("fitting data sets", sets * len(names), quiet) as on_progress:
        table = write_coverage(out, names, sets, seed, on_progress, resume)
    if not quiet:
        from bayes_tyre.report.terminal.console import print_table

        by_kind = overview(table)
        print_table([(str(name), {}) for name in by_kind], by_kind.to_numpy().tolist())
    say("coverage of 95 % intervals ± its standard error, of all data sets", quiet)
    say(f"wrote {out / 'coverage.csv'} (simulated, not measured); failed checks: {out / 'verdicts.csv'}", quiet)


def _names(kinds: str, known: Collection[str]) -> list[str]:
    """Return the names in a list with commas, all that are known where it is empty."""
    names = list(dict.fromkeys(name.strip() for name in kinds.split(","))) if kinds else list(known)
    if unknown := [name for name in names if name not in known]:
        raise typer.BadParameter(f"{unknown[0]!r} is none of {', '.join(known)}", param_hint="--kinds")
    return names


for command in (calibration, outliers, motion, laws, coverage):
    study.command(short_help=first_paragraph(command))(guarded(command, "study"))
