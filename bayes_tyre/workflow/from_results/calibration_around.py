"""Calibration around the records of a fit: its folder in, the files of `study calibration` out."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.results.provenance import RUN_JSON, read_run
from bayes_tyre.studies.around.augmented_fit import AugmentedFit
from bayes_tyre.studies.around.new_records import posterior_truths
from bayes_tyre.studies.around.posterior_calibration import calibrate_around
from bayes_tyre.studies.calibration import Calibration
from bayes_tyre.studies.truths import Truths
from bayes_tyre.workflow.fit import Plan, planned_in
from bayes_tyre.workflow.from_results.predict import read_posterior
from bayes_tyre.workflow.record_tables import read_given
from bayes_tyre.workflow.studies import study_run, write_calibration_files


class Around(NamedTuple):
    """A fit on disk to calibrate around: its folder, the files it came from, its plan, its records, and truths."""

    folder: Path
    inputs: tuple[Path, ...]
    plan: Plan
    records: PreparedRecords
    truths: Truths


def read_around(folder: Path, datasets: int, warn: Callable[[str], None]) -> Around:
    """Return the fit in a folder, with the records that its `run.json` names, found and checked by their SHA-256.

    Raises
    ------
    BadInput
        If the folder holds no finished fit of records with a draw for each data set, or the table of these is gone or
        another.
    """
    read_run(folder / RUN_JSON, otherwise="--around takes a folder that fit wrote from records")
    path, tree, _ = read_posterior(folder)
    plan = planned_in(folder / RUN_JSON, warn)
    with errors_name(path):
        records = prepare_records(read_given(plan.records, plan.columns).table, plan.model)
        truths = posterior_truths(tree, records, plan.model, datasets)
    return Around(folder, (path, *plan.inputs), plan, records, truths)


def write_calibration_around(
    out: Path, around: Around, datasets: int, seed: int, on_progress: Callable[[int], None]
) -> Calibration:
    """Write what `bayes_tyre.workflow.studies.write_calibration` does, with truths drawn from a fit's posterior.

    Raises
    ------
    BadInput
        If `out` is the folder of the fit, or the fit is of one record.
    """
    if out.resolve() == around.folder.resolve():
        raise BadInput(f"--out {out}: is the folder of the fit, whose run.json would be lost; name another")
    with errors_name(around.folder):
        fit = AugmentedFit(around.records, around.plan.model)
    options = {"datasets": datasets, "around": str(around.folder)}
    with study_run("study calibration", out, seed, around.inputs, **options):
        result = calibrate_around(around.truths, fit, seed, on_progress)
        write_calibration_files(out, result, fit.model.priors, "the posterior of the records")
    return result
