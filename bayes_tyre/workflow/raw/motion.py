"""Raw files in; the posterior of tyre, mass and damping from the motion itself out, a folder as `fit` writes it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder, remove_leftovers
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.judge import judge
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.motion.hierarchy.leave_one_out import with_motions
from bayes_tyre.inference.motion.hierarchy.model import Motions, fit_motions
from bayes_tyre.inference.motion.hierarchy.posterior_losses import Middle, with_losses
from bayes_tyre.inference.motion.hierarchy.power_scaling import identify_motions
from bayes_tyre.inference.motion.laws import MOTION_LAWS, motion_law
from bayes_tyre.inference.sampling.common_scales import with_scale
from bayes_tyre.record_table import origin_of
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.results.comparison.law_weights import LAWS_CSV
from bayes_tyre.results.limits import parse_limit
from bayes_tyre.results.provenance import RUN_JSON, begin_run, read_run
from bayes_tyre.rig.axle import Rig
from bayes_tyre.workflow.execution.batch import Machines, run_batch
from bayes_tyre.workflow.execution.resume import Callbacks, open_checkpoints
from bayes_tyre.workflow.execution.task_cache import TaskCache
from bayes_tyre.workflow.raw.estimate_limitations import ESTIMATES, with_estimates
from bayes_tyre.workflow.raw.law_average import weighted
from bayes_tyre.workflow.raw.motion_estimates import BY_LAW, estimate_file, estimates_of, read_parts, shown_motions
from bayes_tyre.workflow.raw.motion_plan import SCALES, MotionPlan
from bayes_tyre.workflow.raw.process_tasks import Settings, Task, plan_tasks
from bayes_tyre.workflow.raw.raw_records import REJECTED, none_usable, rejected
from bayes_tyre.workflow.result_folder import write_fit


@dataclass(frozen=True)
class Estimated:
    """The records' estimates.

    Attributes
    ----------
    table, motions:
        The rows of `estimates.csv`, and the same as the hierarchy takes them.
    rejected:
        File and reason of those without one.
    files, middles:
        The file of each record, and where its cycle goes on.
    shown:
        Readings and fitted motion of a few records; None where they are not kept.
    rig_files:
        Those that rows of the table of cases name.
    laws:
        Of an average over laws `laws.csv`; None of a single law.
    """

    table: pd.DataFrame
    motions: Motions
    rejected: pd.DataFrame
    files: list[Path]
    middles: list[Middle]
    shown: pd.DataFrame | None = None
    rig_files: tuple[Path, ...] = ()
    laws: pd.DataFrame | None = None

    @property
    def origin(self) -> str:
        """Where the signals come from, such as ``simulated``."""
        return origin_of(self.table)


def estimate_files(
    files: Sequence[Path], plan: MotionPlan, machines: Machines, out: Path, on_progress: Callable[[int], None]
) -> Estimated:
    """Return the estimates of raw files, each kept in `out` once it is there.

    Raises
    ------
    BadInput
        If rig, cases, cluster or `out` are of no use, or, to resume, a result there has another law or rig, before the
        work; if no file is of use, after `rejected.csv` was written.
    """
    law = motion_law(plan.law)
    check_folder(out)
    if machines.resume:
        _refuse_other_estimates(out, plan)
    if plan.figures:
        check_folder(plan.figures, "--figures")
    tasks = plan_tasks(files, Settings(plan.rig, plan.cases, f"{BY_LAW}{law.of_records}", plan.figures))
    prepare_folder(out)
    cache = TaskCache(out / ESTIMATES)
    # One rig after the other: what is compiled for one serves its next file, that of two may be too much to keep.
    order = sorted(range(len(tasks)), key=lambda i: _compiled_for(tasks[i]))
    done = run_batch(estimate_file, [tasks[i] for i in order], cache, machines, on_progress)
    outcomes = [end for _, end in sorted(zip(order, done, strict=True), key=lambda pair: pair[0])]
    rows = rejected(files, outcomes)
    estimates = [
        (file, task, end) for file, task, end in zip(files, tasks, outcomes, strict=True) if isinstance(end, Path)
    ]
    if not estimates:
        remove_leftovers([out / REJECTED])
        write_table(rows, out / REJECTED)
        cache.remove()
        (out / RUN_JSON).unlink(missing_ok=True)  # an earlier run's result is not of these files
        raise none_usable(out / REJECTED, rows, len(tasks))
    parts = [part for _, _, part in estimates]
    rigs = [task.rig for _, task, _ in estimates if isinstance(task.rig, Rig)]
    table, laws = weighted(read_parts(parts), rigs, law)
    table, motions = estimates_of(table, law)
    middles = [Middle(rig, float(d)) for rig, d in zip(rigs, table["displacement_mm"], strict=True)]
    shown = shown_motions(parts)
    rig_files = tuple(dict.fromkeys(task.rig_file for _, task, _ in estimates if task.rig_file is not None))
    files = [file for file, _, _ in estimates]
    return Estimated(table, motions, rows, files, middles, shown, rig_files, laws)


def fit_estimates(
    estimated: Estimated,
    plan: MotionPlan,
    out: Path,
    command: Sequence[str],
    callbacks: Callbacks | None = None,
    *,
    resume: bool = False,
    xlsx: bool = False,
) -> Diagnostics:
    """Fit the hierarchy to the estimates of raw files and write the result's folder; return the verdict.

    Parameters
    ----------
    estimated, plan:
        As `estimate_files` gives them, and the plan that it took.
    out, command, callbacks, resume, xlsx:
        As `bayes_tyre.workflow.fit.fit_table` has them.

    Raises
    ------
    BadInput
        If the folder is of no use.
    """
    plan = plan.with_scales_of([middle.rig for middle in estimated.middles])
    callbacks, origin = callbacks or Callbacks(), estimated.origin
    inputs = [*estimated.files, *estimated.rig_files, *plan.input_files]
    of_rows = {"rig_files": [str(path) for path in estimated.rig_files]} if estimated.rig_files else {}
    run = begin_run(command, {**plan.options, **of_rows}, plan.sampler.seed, inputs, origin, callbacks.began)
    checkpoints = open_checkpoints(out, run, callbacks, resume, overwrite=True)  # the estimates are cached
    if isinstance(checkpoints, Diagnostics):
        return checkpoints
    settings, motions, attempts = callbacks.settings(plan.sampler, checkpoints), estimated.motions, Attempts()
    tree = fit_motions(motions, settings, plan.repeats, priors=plan.priors)
    tree.attrs["origin"] = origin
    for number, name in enumerate(SCALES):
        if sd := getattr(plan, name):
            tree = with_scale(tree, name.removesuffix("_sd"), sd, plan.sampler.seed + number)
    tree = attempts(
        "energy of a cycle", lambda: with_losses(tree, motions.factor_table, estimated.middles, plan.amplitude_mm), tree
    )
    callbacks.on_stage("diagnostics", None)
    tree, diagnostics = judge(
        with_motions(tree, motions),
        lambda tree, attempt: identify_motions(tree, motions, plan.priors, attempt),
        attempts,
    )
    diagnostics = with_estimates(diagnostics, estimated.table, len(estimated.rejected), _pooled(estimated, plan))
    beside = {ESTIMATES: estimated.table, REJECTED: estimated.rejected}
    if estimated.laws is not None:
        beside[LAWS_CSV] = estimated.laws
    limit = None if plan.limit is None else parse_limit(plan.limit)
    result = Result(tree, diagnostics.verdict, interval=plan.interval, motions=estimated.shown, limit=limit)
    diagnostics = write_fit(result, diagnostics, run, out, beside, xlsx=xlsx, callbacks=callbacks)
    checkpoints.clear()
    return diagnostics


def _pooled(estimated: Estimated, plan: MotionPlan) -> pd.DataFrame | None:
    """Return `laws.csv` where its weights are those of the estimates."""
    return estimated.laws if motion_law(plan.law).pools else None


def _compiled_for(task: Task) -> tuple[str, bool]:
    """Return what the fit of a file is compiled for: its rig, and whether the tyre rolls."""
    rolls = not isinstance(task.factors, str) and task.factors.case.speed_km_h > 0
    return "" if task.rig is None else task.rig.model_dump_json(), rolls


def _refuse_other_estimates(out: Path, plan: MotionPlan) -> None:
    """Raise if the folder's result rests on estimates by another law or rig: they would be gone with it."""
    result = out / RUN_JSON
    if not result.is_file():
        return
    was = read_run(result, "motion")["options"]
    if _of_records(was.get("law")) == _of_records(plan.law):  # the same estimates, weighted in another way
        was = {**was, "law": plan.law}
    for name in ("law", "rig", "cases"):
        if was.get(name) != plan.options[name]:
            raise BadInput(
                f"{result}: is of another run: option {name} was {was.get(name)}, is {plan.options[name]}; "
                "give another --out, or leave out --resume to begin anew"
            )


def _of_records(law: object) -> object:
    known = MOTION_LAWS.get(str(law))
    return law if known is None else known.of_records
