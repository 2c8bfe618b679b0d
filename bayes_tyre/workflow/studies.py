"""The studies and the audit: computation, figures and files."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
import pandas as pd

from bayes_tyre.formats.files import prepare_folder, write_text
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.published.tables import characteristic_deflection
from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.report.figures.study import (
    RankCurves,
    calibration_plot,
    coverage_plot,
    outlier_calibration_plot,
    outlier_plot,
)
from bayes_tyre.results.provenance import RUN_JSON, begin_run, write_run
from bayes_tyre.studies.audit.grid import FACTOR_NAMES, PLANS, TYPICAL_LEVELS
from bayes_tyre.studies.audit.overview import beta_by_window, bias_by_factor, overview
from bayes_tyre.studies.audit.sentences import conclusion
from bayes_tyre.studies.audit.study import study_audit
from bayes_tyre.studies.calibration import Calibration, SimulatedFit, calibrate
from bayes_tyre.studies.coverage import CoverageFit, coverage, verdicts
from bayes_tyre.studies.design import POINTS, WEAK_POINTS, calibration_design
from bayes_tyre.studies.design_fit import DesignFit
from bayes_tyre.studies.estimates_fit import MotionsFit, PublishedFit
from bayes_tyre.studies.law_ranking import Ranked, rank_laws
from bayes_tyre.studies.motion_study import MotionFit, MotionStudy, StudyRecord, summarise
from bayes_tyre.studies.outliers import Outliers, study_outliers
from bayes_tyre.studies.truths import study_priors
from bayes_tyre.studies.uniformity import TOGETHER, band, pit
from bayes_tyre.workflow.execution.batch import Machines, cached_tables
from bayes_tyre.workflow.execution.task_cache import TaskCache
from bayes_tyre.workflow.fit import sampler_options


@contextmanager
def study_run(command: str, out: Path, seed: int, inputs: Sequence[Path] = (), /, **options: object) -> Iterator[None]:
    """Prepare the folder `out` of a command that simulates its own data; write `run.json` once the block has ended.

    `inputs` are the files that it simulates data like; `options` those of the command but its seed.
    """
    prepare_folder(out)
    run = begin_run(command.split(), {**options, "seed": seed}, seed, inputs, "simulated")
    (out / RUN_JSON).unlink(missing_ok=True)
    yield
    write_run(run, out, device=jax.default_backend())


class CalibrationTarget(NamedTuple):
    """What is calibrated.

    Attributes
    ----------
    model:
        ``records``; ``published``, of the printed case means; or ``motion``, of estimates of motions.
    noise:
        Of records: ``iid``, ``ar1`` or ``student``.
    repeats:
        Of each case; of printed means there are none.
    weak:
        Whether records are weak ones: few points, coarse noise.
    """

    model: str = "records"
    noise: str = "iid"
    repeats: int = 3
    weak: bool = False

    @property
    def options(self) -> dict[str, object]:
        """What `run.json` says of it: the options that its model has."""
        without = {"published": ("noise", "repeats", "weak"), "motion": ("noise", "weak")}.get(self.model, ())
        return {name: value for name, value in self._asdict().items() if name not in without}

    def fit(self) -> tuple[SimulatedFit, Priors]:
        """Return the fit, compiled, and the priors that truths are drawn from."""
        if self.model == "published":
            return PublishedFit(), PRIORS
        design = calibration_design(self.repeats, WEAK_POINTS if self.weak else POINTS)
        if self.model == "motion":
            return MotionsFit(design), PRIORS
        priors = study_priors(self.weak)
        return DesignFit(design, priors=priors, noise=self.noise), priors


def write_calibration(
    out: Path, datasets: int, seed: int, on_progress: Callable[[int], None], target: CalibrationTarget
) -> Calibration:
    """Write what `write_calibration_files` does, with truths drawn from the priors of a calibration."""
    with study_run("study calibration", out, seed, datasets=datasets, **target.options):
        fit, priors = target.fit()
        result = calibrate(datasets, seed, on_progress, fit=fit)
        write_calibration_files(out, result, priors, "the priors")
    return result


def write_calibration_files(out: Path, result: Calibration, priors: Priors, drawn_from: str) -> None:
    """Write the tables of a calibration and its figures into `out`.

    They are `calibration.csv`, `ranks.csv`, `datasets.csv`, `priors.csv`, and where records can be discordant
    `outlier_calibration.csv`, with a figure each. `drawn_from` says what the truths are drawn from.
    """
    write_table(_priors(priors), out / "priors.csv")
    write_table(result.datasets, out / "datasets.csv")
    write_table(result.ranks, out / "ranks.csv")
    write_table(result.table, out / "calibration.csv")
    save(calibration_plot(_curves(result, drawn_from)), out / "figures" / "calibration.png")
    of_outliers = out / "outlier_calibration.csv", out / "figures" / "outlier_calibration.png"
    if result.outliers.empty:
        for path in of_outliers:  # of an earlier run
            path.unlink(missing_ok=True)
        return
    write_table(result.outliers, of_outliers[0])
    save(outlier_calibration_plot(result.outliers), of_outliers[1])


def write_outliers(out: Path, campaigns: int, seed: int, on_progress: Callable[[int], None]) -> Outliers:
    """Write `outliers.csv`, `datasets.csv` and the figure into `out`."""
    with study_run("study outliers", out, seed, campaigns=campaigns):
        result = study_outliers(campaigns, seed, on_progress)
        write_table(result.datasets, out / "datasets.csv")
        write_table(result.table, out / "outliers.csv")
        save(outlier_plot(result.table), out / "figures" / "outliers.png")
    return result


def write_motion_study(
    out: Path,
    records: list[StudyRecord],
    fit: MotionFit,
    on_progress: Callable[[int], None],
    machines: Machines,
    options: Mapping[str, object],
) -> MotionStudy:
    """Write `motion_study.csv` and `motion_records.csv` of fitted records; `run.json` has `options`.

    Each record is cached as it is done; to resume, those in the cache are not fitted again.
    """
    with study_run("study motion", out, fit.seed, law=fit.law, **options):
        cache = TaskCache(out / "motion_study.csv")
        cache.prepare(machines.resume, ())
        # One rig after the other: what is compiled for one serves its next record, that of two may be too much to keep.
        in_turn = sorted(records, key=lambda record: (record.plan.case.configuration, record.kind))
        tasks = {_fingerprint(fit.decides(record)): record for record in in_turn}
        parts = cached_tables(fit.rows, tasks, cache, on_progress, machines.workers)
        part_of = dict(zip(tasks, parts, strict=True))
        table = pd.concat(
            [pd.read_parquet(part_of[_fingerprint(fit.decides(record))]) for record in records], ignore_index=True
        )
        result = MotionStudy(summarise(table), table)
        write_table(result.records, out / "motion_records.csv")
        write_table(result.table, out / "motion_study.csv")
    return result


def write_law_ranking(
    out: Path, true_laws: Sequence[str], records: int, seed: int, on_progress: Callable[[int], None]
) -> Ranked:
    """Write `law_ranking.csv` and `law_ranking_records.csv` into `out`."""
    with study_run("study laws", out, seed, laws=list(true_laws), records=records):
        result = rank_laws(true_laws, records=records, seed=seed, on_progress=on_progress)
        write_table(result.records, out / "law_ranking_records.csv")
        write_table(result.table, out / "law_ranking.csv")
    return result


def write_coverage(
    out: Path, kinds: Sequence[str], sets: int, seed: int, on_progress: Callable[[int], None], resume: bool = False
) -> pd.DataFrame:
    """Write `coverage.csv`, `verdicts.csv`, `coverage_estimates.csv` and the figure into `out`; return the first.

    Each data set is cached as it is done; to resume, those in the cache are not fitted again.
    """
    fit = CoverageFit()
    with study_run("study coverage", out, seed, kinds=list(kinds), sets=sets, **sampler_options(fit.sampler)):
        cache = TaskCache(out / "coverage.csv")
        cache.prepare(resume, ())
        # Of all kinds in turn: of an interrupted study each kind has as many.
        chosen = [(name, seed, number) for number in range(sets) for name in kinds]
        tasks = {_fingerprint(fit.decides(*one)): one for one in chosen}
        parts = cached_tables(lambda one: fit.estimate(*one), tasks, cache, on_progress)
        estimates = pd.concat(
            [pd.read_parquet(part) for i in range(len(kinds)) for part in parts[i :: len(kinds)]], ignore_index=True
        )
        table = coverage(estimates)
        write_table(estimates, out / "coverage_estimates.csv")
        write_table(verdicts(estimates), out / "verdicts.csv")
        write_table(table, out / "coverage.csv")
        save(coverage_plot(table), out / "figures" / "coverage.png")
    return table


def _fingerprint(decides: Mapping[str, object]) -> str:
    """Return the SHA-256 of what determines the table of a simulated data set, and of the package's version."""
    text = json.dumps({"version": version("bayes-tyre"), **decides}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _curves(result: Calibration, drawn_from: str) -> RankCurves:
    """Return the ranks of each parameter against uniform ones, with a band that holds for all parameters together."""
    names, datasets = [str(name) for name in result.ranks.columns[1:]], len(result.ranks)
    at, lower, upper = band(datasets, 1.0 - (1.0 - TOGETHER) / len(names))
    rng, excess = np.random.default_rng(0), {}
    for name in names:
        values = np.sort(pit(result.ranks[name].to_numpy(), result.draws, rng))
        excess[name] = np.searchsorted(values, at, side="right") / datasets - at
    calibrated = dict(zip(result.table["parameter"], result.table["calibrated"], strict=True))
    return RankCurves(at, lower, upper, excess, calibrated, datasets, result.draws, TOGETHER, drawn_from)


def _priors(priors: Priors) -> pd.DataFrame:
    rows = [
        (site, prior.family.__name__, " ".join(f"{value:g}" for value in prior.parameters), prior.unit, prior.reason)
        for site, prior in priors.items()
    ]
    return pd.DataFrame(rows, columns=["site", "family", "parameters", "unit", "reason"])


def write_audit(
    out: Path, plan: str, replicates: int, seed: int, on_progress: Callable[[int], None]
) -> tuple[pd.DataFrame, list[str]]:
    """Write `audit.csv`, `audit_records.csv`, `conclusion.txt` and the figures into `out`.

    Returns the overview, a row a method and parameter, and the conclusion's paragraphs.

    Parameters
    ----------
    out:
        Folder, made where it is missing.
    plan:
        A name in `bayes_tyre.studies.audit.grid.PLANS`.
    replicates, seed:
        Records a point, and where their draws start.
    on_progress:
        Called with 1 after each record.
    """
    with study_run("audit", out, seed, plan=plan, replicates=replicates):
        result = study_audit(PLANS[plan], replicates, seed, on_progress)
        biases = overview(result.table)
        paragraphs = conclusion(result.table, characteristic_deflection()["beta_mm"].tolist())
        write_table(result.records, out / "audit_records.csv")
        write_table(result.table, out / "audit.csv")
        write_text("\n\n".join(paragraphs) + "\n", out / "conclusion.txt")
        tables = (result.table, bias_by_factor(result.table, "k"), biases, beta_by_window(result.table, "thesis"))
        for name, figure in audit_figures.draw(*tables, FACTOR_NAMES, TYPICAL_LEVELS):
            save(figure, out / "figures" / f"{name}.png")
    return biases, paragraphs
