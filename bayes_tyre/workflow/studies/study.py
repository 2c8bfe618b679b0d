"""The studies: computation, figures and files."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables import write_table
from bayes_tyre.report.figures.layout import save
from bayes_tyre.report.figures.study import RankCurves, calibration_plot, outlier_plot
from bayes_tyre.results.provenance import RUN_JSON, begin_run, write_run
from bayes_tyre.studies.calibration import Calibration, calibrate
from bayes_tyre.studies.law_ranking import Ranked, rank_laws
from bayes_tyre.studies.motion_study import MotionStudy, StudyRecord, study_motion
from bayes_tyre.studies.outliers import Outliers, study_outliers
from bayes_tyre.studies.truths import study_priors
from bayes_tyre.studies.uniformity import TOGETHER, band, pit

ORIGIN = "simulated"


def write_calibration(
    out: Path, datasets: int, seed: int, options: Mapping[str, object], on_progress: Callable[[int], None]
) -> Calibration:
    """Write `calibration.csv`, `ranks.csv`, `datasets.csv`, `priors.csv` and the figure into `out`."""
    prepare_folder(out)
    run = begin_run("bayes-tyre study calibration", options, seed, [], ORIGIN)
    (out / RUN_JSON).unlink(missing_ok=True)
    result = calibrate(datasets, seed, on_progress)
    write_table(_priors(), out / "priors.csv")
    write_table(result.datasets, out / "datasets.csv")
    write_table(result.ranks, out / "ranks.csv")
    write_table(result.table, out / "calibration.csv")
    save(calibration_plot(_curves(result)), out / "figures" / "calibration.png")
    write_run(run, out)
    return result


def write_outliers(
    out: Path, campaigns: int, seed: int, options: Mapping[str, object], on_progress: Callable[[int], None]
) -> Outliers:
    """Write `outliers.csv`, `datasets.csv` and the figure into `out`."""
    prepare_folder(out)
    run = begin_run("bayes-tyre study outliers", options, seed, [], ORIGIN)
    (out / RUN_JSON).unlink(missing_ok=True)
    result = study_outliers(campaigns, seed, on_progress)
    write_table(result.datasets, out / "datasets.csv")
    write_table(result.table, out / "outliers.csv")
    save(outlier_plot(result.table), out / "figures" / "outliers.png")
    write_run(run, out)
    return result


def write_motion_study(
    out: Path, records: list[StudyRecord], seed: int, options: Mapping[str, object], on_progress: Callable[[int], None]
) -> MotionStudy:
    """Write `motion_study.csv` and `motion_records.csv` into `out`."""
    prepare_folder(out)
    run = begin_run("bayes-tyre study motion", options, seed, [], ORIGIN)
    (out / RUN_JSON).unlink(missing_ok=True)
    result = study_motion(records, seed, on_progress)
    write_table(result.records, out / "motion_records.csv")
    write_table(result.table, out / "motion_study.csv")
    write_run(run, out)
    return result


def write_law_ranking(
    out: Path,
    true_laws: Sequence[str],
    records: int,
    seed: int,
    options: Mapping[str, object],
    on_progress: Callable[[int], None],
) -> Ranked:
    """Write `law_ranking.csv` and `law_ranking_records.csv` into `out`."""
    prepare_folder(out)
    run = begin_run("bayes-tyre study laws", options, seed, [], ORIGIN)
    (out / RUN_JSON).unlink(missing_ok=True)
    result = rank_laws(true_laws, records=records, seed=seed, on_progress=on_progress)
    write_table(result.records, out / "law_ranking_records.csv")
    write_table(result.table, out / "law_ranking.csv")
    write_run(run, out)
    return result


def _curves(result: Calibration) -> RankCurves:
    """Return the ranks of each parameter against uniform ones, with a band that holds for all parameters together."""
    names, datasets = [str(name) for name in result.ranks.columns[1:]], len(result.ranks)
    at, lower, upper = band(datasets, 1.0 - (1.0 - TOGETHER) / len(names))
    rng, excess = np.random.default_rng(0), {}
    for name in names:
        values = np.sort(pit(result.ranks[name].to_numpy(), result.kept, rng))
        excess[name] = np.searchsorted(values, at, side="right") / datasets - at
    right = dict(zip(result.table["parameter"], result.table["calibrated"], strict=True))
    return RankCurves(at, lower, upper, excess, right, datasets, result.kept, TOGETHER)


def _priors() -> pd.DataFrame:
    rows = [
        (site, prior.family.__name__, " ".join(f"{value:g}" for value in prior.parameters), prior.unit, prior.reason)
        for site, prior in study_priors().items()
    ]
    return pd.DataFrame(rows, columns=["site", "family", "parameters", "unit", "reason"])
