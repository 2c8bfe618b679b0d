"""Errors and coverage of the motion fit on simulated records, with and without a mismatch between model and truth."""

import time
from collections.abc import Sequence
from itertools import cycle, islice, product, zip_longest
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw, motion_law
from bayes_tyre.inference.motion.record.estimate import RECORD_PARAMETERS, MotionEstimate
from bayes_tyre.inference.motion.record.law_average import NOT_CONVERGED, converged_estimate
from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.record import RECORD_UNITS, parameter_column
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.process import prepare
from bayes_tyre.simulate.draw import draw_truth, stream
from bayes_tyre.simulate.plan import Planned, thesis_plan
from bayes_tyre.simulate.truth import Truth
from bayes_tyre.studies.motion_machine import recorded_on
from bayes_tyre.studies.motion_mismatch import MISMATCHES
from bayes_tyre.studies.uniformity import share_interval

STATIONARY, ROLLING = "stationary", "rolling"
ORIGIN = "simulated"
CHANNELS = ("acceleration", "laser", "load")
#: Mismatches by name; the first of all records is none.
MISMATCHED = tuple(MISMATCHES)[1:]
_NORMAL_95 = float(stats.norm.ppf(0.975))
# Duration and start of the step of a record, s: enough rest before it to estimate turns and levels, enough after it for
# the vibration to decay.
_LENGTH = {STATIONARY: (4.5, (2.1, 2.3)), ROLLING: (6.0, (4.0, 5.3))}


class MotionStudy(NamedTuple):
    """Result of the study.

    Attributes
    ----------
    table:
        A row a mismatch, kind and parameter: root mean square error and bias (%), coverage, number of records
        with a status other than ``ok`` (`doubted`); of those without an estimate, as `motion` has none (`declined`);
        and of those among them whose fit did not converge (`not_converged`).
    records:
        A row a record and parameter.
    """

    table: pd.DataFrame
    records: pd.DataFrame


class StudyRecord(NamedTuple):
    """One record of the study: mismatch (a name in `MISMATCHES`), kind, its number, and its plan."""

    mismatch: str
    kind: str
    number: int
    plan: Planned


def study_records(
    stationary: int,
    rolling: int,
    seed: int,
    mismatched: int = 0,
    standing_only: bool = False,
    mismatches: Sequence[str] = MISMATCHED,
) -> list[StudyRecord]:
    """Return the records of a study: cases in random order, balanced over axles, directions and speeds.

    Parameters
    ----------
    stationary, rolling:
        Number of records of each kind.
    seed:
        Of the order.
    mismatched:
        Number of records of each kind with each mismatch that it can have; the first cases of its kind.
    standing_only:
        Whether mismatches are those of stationary records alone.
    mismatches:
        Which mismatches, names in `MISMATCHED`.
    """
    records = []
    for kind, count in ((STATIONARY, stationary), (ROLLING, rolling)):
        plans = _cases(kind, max(count, mismatched), seed)
        records += [StudyRecord("none", kind, i, plan) for i, plan in enumerate(plans[:count])]
        for name in () if standing_only and kind == ROLLING else mismatches:
            if kind == ROLLING or not MISMATCHES[name].rolling_only:
                records += [StudyRecord(name, kind, i, plan) for i, plan in enumerate(plans[:mismatched])]
    return records


def _cases(kind: str, count: int, seed: int) -> list[Planned]:
    """Return plans of a kind, in random order within groups of axle, direction and speed, the groups in turn.

    Of more than the test plan has they begin again: with other truths, which have the number of their record.
    """
    plans = [plan for plan in thesis_plan() if (plan.case.speed_km_h > 0) == (kind == ROLLING)]
    rng = stream(seed, "motion study", kind)
    groups: dict[tuple[object, ...], list[Planned]] = {}
    for i in rng.permutation(len(plans)):
        case = plans[i].case
        groups.setdefault((case.configuration, case.direction, case.speed_km_h), []).append(plans[i])
    in_turn = [plan for round_ in zip_longest(*groups.values()) for plan in round_ if plan is not None]
    duration_s, between = _LENGTH[kind]
    return [plan._replace(duration_s=duration_s, step_between_s=between) for plan in islice(cycle(in_turn), count)]


class MotionFit(NamedTuple):
    """How the records of a study are simulated and fitted.

    Attributes
    ----------
    seed:
        Of axles, tyres and noise, which differ between records.
    law:
        Of the fit: `fancher`, one that extends it, or `auto`.
    """

    seed: int
    law: str = FANCHER.name

    def rows(self, record: StudyRecord) -> pd.DataFrame:
        """Return the rows of one record of `MotionStudy.records`, simulated and fitted; in any process."""
        prepare_jax()
        return pd.DataFrame(_rows(record, self.seed, motion_law(self.law)))

    def decides(self, record: StudyRecord) -> dict[str, object]:
        """Return what determines the rows of a record beside the package's version, ready for JSON."""
        plan = record.plan._replace(case=record.plan.case._asdict())._asdict()
        return {**self._asdict(), **record._asdict(), "plan": plan}


def _rows(record: StudyRecord, seed: int, law: MotionLaw) -> list[dict[str, object]]:
    plan, rig = record.plan, load_rig(record.plan.case.configuration)
    # The same axle, tyre and noise with each mismatch: differences are the mismatch's.
    record_seed = int(stream(seed, "motion study", record.kind, str(record.number)).integers(2**32))
    mismatch = MISMATCHES[record.mismatch]
    truth = mismatch.change(draw_truth(plan, rig, record_seed), rig)
    factors = {"mismatch": record.mismatch, "kind": record.kind, "record": plan.record, **plan.case._asdict()}
    raw = recorded_on(mismatch.machine, truth, rig)
    began = time.process_time()
    try:
        recording = prepare(raw, rig, RecordFactors(plan.record, plan.case, plan.repeat))
        estimate = converged_estimate(rig, Recorded(*recording.for_motion()), law)
    except BadInput as error:
        return [
            {**factors, "seed": record_seed, **row, "status": str(error), "origin": ORIGIN}
            for row in _parameter_rows(truth, None)
        ]
    fit = {"method": estimate.method, "pareto_k": estimate.pareto_k, **_residual_statistics(estimate)}
    fit |= {f"weight_{name}": weight for name, weight in estimate.law_weights.items()}
    shares = {"discrepancy": estimate.discrepancy_share, "load_departure": estimate.load_departure_share}
    fit |= {f"{name}_percent": 100 * share for name, share in shares.items()}
    fit |= {"cpu_seconds": time.process_time() - began, "status": estimate.status or "ok", "origin": ORIGIN}
    return [{**factors, "seed": record_seed, **row, **fit} for row in _parameter_rows(truth, estimate)]


def _parameter_rows(truth: Truth, estimate: MotionEstimate | None) -> list[dict[str, object]]:
    rows = []
    for i, name in enumerate(RECORD_PARAMETERS):
        true = float(getattr(truth, parameter_column(name)))
        log = np.nan if estimate is None else float(estimate.log_mean[i])
        sd = np.nan if estimate is None else float(np.sqrt(estimate.log_covariance[i, i]))
        lower, upper = np.exp(log - _NORMAL_95 * sd), np.exp(log + _NORMAL_95 * sd)
        row = {"parameter": name, "unit": RECORD_UNITS[name], "truth": true}
        row |= {"estimate": np.exp(log), "sd": np.exp(log) * sd}
        row |= {"lower": lower, "upper": upper, "inside": bool(lower <= true <= upper)}
        rows.append(row | {"error_percent": 100 * float(np.exp(log) / true - 1)})
    return rows


def _residual_statistics(estimate: MotionEstimate) -> dict[str, float]:
    peak = estimate.map_estimate
    squares = {f"chi_squared_{name}": float(value) for name, value in zip(CHANNELS, peak.chi_squared, strict=True)}
    correlations = {
        f"autocorrelation_{name}": float(value) for name, value in zip(CHANNELS, peak.correlation, strict=True)
    }
    return squares | correlations


def summarise(records: pd.DataFrame) -> pd.DataFrame:
    """Return `MotionStudy.table` of `MotionStudy.records`."""
    rows = []
    groups = records[["mismatch", "kind"]].drop_duplicates().to_numpy()
    for (mismatch, kind), name in product(groups, RECORD_PARAMETERS):
        group = records[(records["mismatch"] == mismatch) & (records["kind"] == kind) & (records["parameter"] == name)]
        estimated = group[group["estimate"].notna()]
        factors = {
            "mismatch": mismatch,
            "kind": kind,
            "parameter": name,
            "records": len(group),
            "declined": len(group) - len(estimated),
            "not_converged": int(group["status"].str.startswith(NOT_CONVERGED).sum()),
        }
        rows.append({**factors, **_statistics(estimated), "origin": ORIGIN})
    return pd.DataFrame(rows)


#: Columns of `MotionStudy.table` that are of the records with an estimate.
_OF_ESTIMATES = (
    *("rms_error_percent", "bias_percent", "bias_se_percent", "rms_sd_percent"),
    *("coverage_95", "coverage_95_lower", "coverage_95_upper", "pareto_k_largest", "cpu_seconds_median"),
)


def _statistics(rows: pd.DataFrame) -> dict[str, float | int]:
    error, n, inside = rows["error_percent"].to_numpy(float), len(rows), int(rows["inside"].sum())
    if n == 0:
        return {**dict.fromkeys(_OF_ESTIMATES, np.nan), "doubted": 0}
    lower, upper = share_interval(inside, n)
    doubted = int((rows["status"] != "ok").sum()) if "status" in rows else 0
    return {
        "rms_error_percent": float(np.sqrt(np.mean(error**2))),
        "bias_percent": float(error.mean()),
        "bias_se_percent": float(error.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan,
        "rms_sd_percent": float(100 * np.sqrt(np.mean((rows["sd"] / rows["estimate"]) ** 2))),
        "coverage_95": inside / n,
        "coverage_95_lower": lower,
        "coverage_95_upper": upper,
        "doubted": doubted,
        "pareto_k_largest": float(rows["pareto_k"].max()),
        "cpu_seconds_median": float(rows["cpu_seconds"].median()),
    }


def sentences(table: pd.DataFrame) -> list[str]:
    """Return a line a mismatch and kind: errors and coverage, numbers doubted and estimated, processor time."""
    lines = []
    for (mismatch, kind), rows in table.groupby(["mismatch", "kind"], sort=False):
        if rows["declined"].eq(rows["records"]).all():
            lines.append(f"{kind}, mismatch {mismatch}: none of {rows['records'].max()} records has an estimate")
            continue
        columns = rows[["parameter", "rms_error_percent", "bias_percent", "coverage_95"]]
        errors = [
            f"{name} {rms:.2g} % (bias {bias:+.2g}, coverage {share:.0%})"
            for name, rms, bias, share in columns.itertuples(index=False)
        ]
        first = rows.iloc[0]
        heading = f"{kind}, mismatch {mismatch}, {first['records']} records, {first['doubted']} doubted"
        not_converged = first.get("not_converged", 0)  # of an older study it is not known
        lost = f", {not_converged} did not converge" if not_converged else ""
        estimated = f"{first['records'] - first['declined']} with an estimate{lost}"
        cost = f"{first['cpu_seconds_median']:.2g} s of processor time a record"
        lines.append(f"{heading}: rms error {', '.join(errors)}; {estimated}, {cost}")
    return lines
