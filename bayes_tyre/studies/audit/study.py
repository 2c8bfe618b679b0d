"""The audit: bias and coverage of `thesis`, `inertia` and `motion` on simulated records of known k, x and beta.

One stationary rig. The simulator's law is the one that `motion` fits, and its load shape is one that `motion` allows.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.inertia import inertia
from bayes_tyre.signals.process import prepare
from bayes_tyre.signals.processed import Processed, Recording
from bayes_tyre.signals.thesis import thesis
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.studies.audit.grid import CONFIGURATION, FACTORS, PLANS, WINDOW, Plan, Tyre, truth_of
from bayes_tyre.studies.audit.methods import (
    ESTIMATED,
    UNITS,
    MethodEstimate,
    curve,
    least_squares_estimates,
    motion_estimate,
    true_value,
)

#: The columns of `audit.csv`.
COLUMNS = (
    *FACTORS,
    *("method", "parameter", "unit", "truth", "median", "bias_percent", "rmse_percent", "coverage_95", "intervals"),
    *("returned", "declined", "doubted", "origin"),
)
ORIGIN = "simulated"


class Audit(NamedTuple):
    """Result of the study.

    Attributes
    ----------
    table:
        A row a method, grid point and parameter, columns `COLUMNS`: the truths and, of `thesis`, the window (empty for
        methods that smooth nothing); median returned and its bias, root mean square error (% of the truth), share of
        `intervals` that hold the truth; records of which a value was returned; those declined, by the method or because
        they do not determine the parameter; and of those returned how many have a status other than ``ok``.
    records:
        A row a record, method, window and parameter: `value`, `lower`, `upper` of its 95 % interval, `status`.
    """

    table: pd.DataFrame
    records: pd.DataFrame


class _Branches(NamedTuple):
    """One simulated record, processed: curves of `thesis` by window and of `inertia`, and the estimate of `motion`."""

    thesis: dict[int, pd.DataFrame | str]
    inertia: pd.DataFrame | str
    motion: MethodEstimate


def count_records(plan: Plan, replicates: int) -> int:
    """Return how many records the audit simulates."""
    return replicates * len(plan.tyres())


def study_audit(
    plan: Plan = PLANS["quick"], replicates: int = 3, seed: int = 0, on_progress: Callable[[int], None] = lambda _: None
) -> Audit:
    """Return the errors and coverage of each method over the points of a plan.

    Parameters
    ----------
    plan:
        Levels of truths and windows.
    replicates:
        Records a point.
    seed:
        Of axles and noise.
    on_progress:
        Called with 1 after each record.
    """
    rig = load_rig(CONFIGURATION)
    tasks = [(tyre, replicate) for tyre in plan.tyres() for replicate in range(1, replicates + 1)]
    work = partial(_branches, plan=plan, rig=rig, seed=seed)
    processed = []
    for branches in _in_threads(work, tasks):
        processed.append(branches)
        on_progress(1)
    records = tidy(_estimates(tasks, processed, rig), rig)
    return Audit(summarise(records), records)


def _in_threads(work: Callable[[tuple[Tyre, int]], _Branches], tasks: list[tuple[Tyre, int]]) -> Iterator[_Branches]:
    """Yield the work on each task in order, a thread a core: most of the time is spent in XLA."""
    yield work(tasks[0])  # it compiles; two at a time would compile twice
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(work, tasks[1:])


def _branches(task: tuple[Tyre, int], plan: Plan, rig: Rig, seed: int) -> _Branches:
    tyre, replicate = task
    truth = truth_of(tyre, replicate, rig, seed)
    factors = RecordFactors(truth.plan.record, truth.plan.case, replicate)
    windows = plan.windows_of(tyre)
    try:
        recording = prepare(simulate_record(truth, rig).raw, rig, factors)
    except BadInput as error:
        return _Branches(dict.fromkeys(windows, str(error)), str(error), MethodEstimate({}, str(error)))
    dt_s = recording.signals.dt_s
    smoothed = {n: _curve_or_reason(partial(thesis, window_s=n * dt_s), recording, rig) for n in windows}
    return _Branches(smoothed, _curve_or_reason(inertia, recording, rig), motion_estimate(recording, tyre, rig))


def _curve_or_reason(
    method: Callable[[Recording, Rig], Processed], recording: Recording, rig: Rig
) -> pd.DataFrame | str:
    try:
        return curve(method(recording, rig))
    except BadInput as error:
        return str(error)


#: Point, replicate, window (None where nothing is smoothed), method, and its estimate.
Estimated = tuple[Tyre, int, int | None, str, MethodEstimate]


def _estimates(tasks: list[tuple[Tyre, int]], processed: list[_Branches], rig: Rig) -> list[Estimated]:
    """Return every estimate, least squares of all records of a method together."""
    pairs = list(zip(tasks, processed, strict=True))
    smoothed = [(*task, n, curve) for task, branches in pairs for n, curve in branches.thesis.items()]
    plain = [(*task, None, branches.inertia) for task, branches in pairs]
    rows: list[Estimated] = []
    for method, curves in (("thesis", smoothed), ("inertia", plain)):
        estimates = least_squares_estimates([curve for *_, curve in curves], [tyre for tyre, *_ in curves], method, rig)
        rows += [(tyre, n, window, method, one) for (tyre, n, window, _), one in zip(curves, estimates, strict=True)]
    return rows + [(*task, None, "motion", branches.motion) for task, branches in pairs]


def tidy(estimates: list[Estimated], rig: Rig) -> pd.DataFrame:
    """Return `Audit.records`: a row a parameter of each estimate, values empty where there is none."""
    rows = [
        {**tyre._asdict(), WINDOW: window, "replicate": replicate, "method": method, "parameter": parameter}
        | {"unit": UNITS[parameter], "truth": true_value(parameter, tyre, rig)}
        | dict(zip(("value", "lower", "upper"), estimate.values.get(parameter, (np.nan,) * 3), strict=True))
        | {"status": estimate.status, "origin": ORIGIN}
        for tyre, replicate, window, method, estimate in estimates
        for parameter in ESTIMATED[method]
    ]
    return pd.DataFrame(rows).astype({WINDOW: "Int64"})


def summarise(records: pd.DataFrame) -> pd.DataFrame:
    """Return `Audit.table` of `Audit.records`."""
    keys = [*FACTORS, "method", "parameter", "unit", "truth"]
    table = [
        dict(zip(keys, key, strict=True)) | _statistics(group)
        for key, group in records.groupby(keys, sort=False, dropna=False)
    ]
    return pd.DataFrame(table).astype({WINDOW: "Int64"}).assign(origin=ORIGIN)[list(COLUMNS)]


def _statistics(records: pd.DataFrame) -> dict[str, float | int]:
    returned = records["value"].notna()
    relative = records.loc[returned, "value"] / records.loc[returned, "truth"] - 1
    between = records["lower"].notna() & records["upper"].notna() & returned
    covered = (records["lower"] <= records["truth"]) & (records["truth"] <= records["upper"])
    return {
        "median": float(records["value"].median()),
        "bias_percent": 100 * float(relative.median()),
        "rmse_percent": 100 * float(np.sqrt(np.mean(relative**2))) if returned.any() else np.nan,
        "coverage_95": float(covered[between].mean()) if between.any() else np.nan,
        "intervals": int(between.sum()),
        "returned": int(returned.sum()),
        "declined": int((~returned).sum()),
        "doubted": int((returned & (records["status"] != "ok")).sum()),
    }
