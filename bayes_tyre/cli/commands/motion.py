"""`motion`: tyre, mass and damping from raw signals by the motion itself, all records together."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli import sampled, shell
from bayes_tyre.cli.model_options import (
    DisplacementScaleOption,
    ForceScaleOption,
    MotionLaw,
    PriorsOption,
    RepeatsOption,
)
from bayes_tyre.cli.raw import CasesTable, Cluster, RawFiles, RigName, Workers, check_machines
from bayes_tyre.runtime import prepare_jax

if TYPE_CHECKING:
    from bayes_tyre.workflow.execution.batch import Machines
    from bayes_tyre.workflow.raw.motion_plan import MotionPlan


def motion(
    raw: RawFiles,
    out: shell.Out,
    rig: RigName = None,
    cases: CasesTable = None,
    law: Annotated[
        MotionLaw,
        typer.Option(
            help="Force law of the tyre; auto averages over Fancher's and its extensions, record by record, and "
            "auto_campaign over all records of a configuration."
        ),
    ] = "fancher",
    amplitude: Annotated[
        float,
        typer.Option(
            min=1e-3, max=100.0, help="Half the stroke at the wheel centre (mm) of the cycle that loses energy."
        ),
    ] = 1.0,
    repeats: RepeatsOption = "mixture",
    displacement_scale_sd: DisplacementScaleOption = None,
    force_scale_sd: ForceScaleOption = None,
    priors: PriorsOption = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for a figure a record: readings, fitted motion, what is left over.")
    ] = None,
    chains: shell.Chains = 4,
    warmup: shell.Warmup = 600,
    draws: shell.Draws = None,
    target_accept: shell.TargetAccept = None,
    seed: shell.Seed = 0,
    interval: shell.Interval = 0.95,
    limit: shell.LimitOption = None,
    workers: Workers = None,
    cluster: Cluster = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Estimate only records that are missing or have changed, then go on from the checkpoint; with other "
            "--draws, --amplitude and the like the hierarchy is fitted anew.",
        ),
    ] = False,
    xlsx: shell.Xlsx = False,
    quiet: shell.Quiet = False,
) -> None:
    """Identify k, x, beta (kN/mm, kN, mm), m (kg), c (kN s/mm) and energy lost (J) from the axle's own motion.

    Other laws have other parameters: kelvin_voigt k alone, bouc_wen k, settled (kN), beta and exponent n, maxwell_slip
    k, settled and beta, rigid_ring k and the belt's frequency (Hz), damping ratio and ratio of sidewall to residual
    stiffness. compare says which of them predicts the same files best. Four extend Fancher's law, with the same
    parameters: rubber that relaxes (relaxing), friction that changes with speed (speed_friction), stiffness that grows
    with deflection (stiffening), two yield displacements (two_yields). auto fits these and Fancher's, and averages them
    record by record, weighted by their evidence; auto_campaign weights all records of a configuration alike, by the
    sum of their evidence, for a tyre has one law. With either laws.csv has the sums, and which law carried the weight.

    Each raw file is fitted by itself, its motion simulated through step and ring-down; the estimates with their
    covariances then go into one hierarchy. Writes what fit writes (--xlsx likewise), and estimates.csv (a row a record)
    and rejected.csv (file, reason); with no usable file only the latter, and exit 3. Ends with code 4 when the
    diagnostics say that the result is not to be trusted. Estimates are kept, file by file, in .estimates.csv.parts, for
    --resume.

    Example: bayes-tyre motion data/raw --out results/motion --figures results/motion/records
    """
    began = time.monotonic()
    check_machines(workers, cluster)
    from bayes_tyre.formats.recordings.raw import raw_files

    files, passed_over = raw_files(raw)  # before what takes seconds to import
    from bayes_tyre.inference.motion.laws import motion_law
    from bayes_tyre.record import ENERGY
    from bayes_tyre.workflow.execution.batch import Machines
    from bayes_tyre.workflow.fit import read_priors
    from bayes_tyre.workflow.raw.motion_plan import MotionPlan

    for warning in passed_over:
        shell.warn(warning)
    sampler = sampled.settings(chains, warmup, draws, seed, target_accept)
    limit = shell.checked_limit(limit, (*motion_law(law).reported_parameters, ENERGY))
    how = law, amplitude, repeats, interval, read_priors(priors), limit, displacement_scale_sd, force_scale_sd
    plan = MotionPlan(sampler, rig, cases, figures, *how)
    _run(files, plan, Machines(workers, cluster, resume), out, xlsx, quiet, began)


def _run(
    files: list[Path], plan: "MotionPlan", machines: "Machines", out: Path, xlsx: bool, quiet: bool, began: float
) -> None:
    """Estimate each file, fit the estimates as planned, print its progress, and end as the verdict says."""
    from bayes_tyre.workflow.raw.motion import estimate_files, fit_estimates
    from bayes_tyre.workflow.raw.raw_records import REJECTED, rejection_notes

    sampler = plan.sampler
    prepare_jax(sampler.chains)
    with shell.progress("motion", len(files), quiet) as advance:
        estimated = estimate_files(files, plan, machines, out, advance)
    for text in rejection_notes(estimated.rejected, out / REJECTED):
        shell.warn(text)
    counts = f"{len(estimated.table)} records, {len(estimated.rejected)} rejected"
    shell.say(f"{counts} (data: {estimated.origin}), {sampler.chains} chains", quiet)
    options = {"reference": None, "amplitude_mm": plan.amplitude_mm}
    sampled.fitted(
        lambda callbacks: fit_estimates(
            estimated, plan, out, sys.argv[1:], callbacks, resume=machines.resume, xlsx=xlsx
        ),
        out=out,
        origin=estimated.origin,
        options=options,
        quiet=quiet,
        limited=plan.limit is not None,
        began=began,
    )
