"""Estimate of the motion in one raw file: a row of `estimates.csv`, cached as a part, and its figure."""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Float

from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.inference.motion.hierarchy.model import Motions, Readings
from bayes_tyre.inference.motion.laws import EXTENSIONS, FANCHER, KELVIN_VOIGT, MotionLaw, motion_law
from bayes_tyre.inference.motion.record.estimate import MotionEstimate
from bayes_tyre.inference.motion.record.law_average import converged_estimate
from bayes_tyre.inference.motion.record.map_fit import CORRELATION_MOST, MISFIT_MOST, MapEstimate
from bayes_tyre.inference.motion.record.model.forward_model import predicted, residuals
from bayes_tyre.inference.motion.record.model.parameters import MotionParameters, parameter_names
from bayes_tyre.inference.motion.record.model.window import Recorded, Window
from bayes_tyre.record import FACTORS
from bayes_tyre.results.figure_data.motion_traces import COLUMNS, places, readings_table
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion_decay import ring_down
from bayes_tyre.rig.sensors import columns_of
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals.process import prepare
from bayes_tyre.workflow.execution.outcome import Done, Fault, attempted
from bayes_tyre.workflow.raw.estimate_columns import (
    BY_DECAY,
    CONSTANT,
    EFFECTIVE,
    LAW_ROWS,
    LOG_EVIDENCE,
    MEAN,
    OK,
    ROWS,
    TARGET,
    VARIANCE,
    WEIGHT,
    columns,
    fit_columns,
    law_row,
    posterior_columns,
    posterior_of,
)
from bayes_tyre.workflow.raw.process_tasks import Task
from bayes_tyre.workflow.raw.raw_records import origin_of_raw, usable

#: Before the name of the law in the method that a task names.
BY_LAW = "motion on "
#: For the figures of a few motions: misfit, as a share of the limit of its check; the table of readings, flattened;
#: and the columns shown with it.
MISFIT, READINGS, ROW_COLUMNS = "misfit", "readings", ("record", "configuration", "status", "origin")


def estimate_file(task: Task) -> Done | Fault:
    """Return the row of a file's estimate and its figure if one is wanted, or why there is none."""
    prepare_jax()
    return attempted(_done, task)


def _done(task: Task) -> Done:
    factors, rig = usable(task)
    raw = read_raw(task.file, columns_of(rig))
    law = motion_law(task.method.removeprefix(BY_LAW))
    estimate = converged_estimate(rig, Recorded(*prepare(raw, rig, factors).for_motion()), law)
    unknowns = estimate.window.in_units(rig, jnp.asarray(estimate.map_estimate.standard))
    origin = origin_of_raw(raw, task)
    row = {**factors.row(), **_columns(rig, estimate, unknowns), "origin": origin}
    readings = readings_table(
        estimate.window, *map(np.asarray, _fitted(rig, estimate.map_estimate.standard, estimate.window))
    )
    figure = None
    if task.figure is not None:
        from bayes_tyre.report.figures.motion import motion_figure
        from bayes_tyre.report.figures.page.colours import Setting
        from bayes_tyre.report.figures.page.layout import png

        drawn = readings.assign(**{name: row[name] for name in ROW_COLUMNS})
        figure = png(lambda: motion_figure(drawn, Setting(origin)))
    return Done(pd.DataFrame([row | _kept_readings(readings, estimate)]), figure)


@functools.partial(jax.jit, static_argnums=0)
def _fitted(
    rig: Rig, standard: Float[Array, " unknowns"], window: Window
) -> tuple[Float[Array, "3 blocks"], Float[Array, "3 blocks"]]:
    """Return the sensor readings that the fitted motion predicts, and the residuals that were checked."""
    unknowns = window.in_units(rig, standard)
    expected = predicted(rig, unknowns, window, window.mean_disturbance)
    return expected, residuals(rig, standard, window)[: expected.size].reshape(expected.shape)


def _kept_readings(readings: pd.DataFrame, estimate: MotionEstimate) -> dict[str, Any]:
    fit = estimate.map_estimate
    shares = np.asarray(fit.chi_squared) / (1 + MISFIT_MOST), np.asarray(fit.correlation) / CORRELATION_MOST
    return {MISFIT: float(np.nanmax(shares)), READINGS: readings[list(COLUMNS)].to_numpy(float).ravel().tolist()}


def _columns(rig: Rig, estimate: MotionEstimate, unknowns: MotionParameters) -> dict[str, Any]:
    law = estimate.window.law
    row = posterior_columns(rig, posterior_of(estimate), law) | fit_columns(rig, estimate, unknowns)
    row |= _extensions(estimate.window, estimate.map_estimate)
    row |= {f"{WEIGHT}{name}": weight for name, weight in estimate.law_weights.items()}
    if law is KELVIN_VOIGT:
        row |= dict(zip(BY_DECAY, _by_decay(estimate.window, unknowns), strict=True))
    if estimate.law_weights:
        found = {name: each for name, each in estimate.by_law.items() if each.has_posterior}
        logs = dict.fromkeys(estimate.law_weights, np.nan) | {n: each.log_evidence for n, each in found.items()}
        row |= {f"{LOG_EVIDENCE}{name}": log for name, log in logs.items()}
        row[LAW_ROWS] = [law_row(rig, name, each).kept() for name, each in found.items()]
    return row


def _extensions(window: Window, estimate: MapEstimate) -> dict[str, float]:
    """Return the extensions of a record's law at the most probable parameters, each with its standard error."""
    names, (mean, sd) = parameter_names(window.law), np.asarray(window.prior)
    errors = np.sqrt(np.diag(np.asarray(estimate.covariance)))
    row: dict[str, float] = {}
    for name in window.law.extensions:
        i = names.index(name)
        at = jnp.asarray(mean[i] + sd[i] * estimate.standard[i])
        value, slope = jax.value_and_grad(EXTENSIONS[name].value)(at)
        row |= {name: float(value), f"{name}_se": float(slope * sd[i] * errors[i])}
    return row


def _by_decay(window: Window, unknowns: MotionParameters) -> tuple[float, float]:
    """Return k, kN/mm, and c, kN s/mm, at the wheel centre from what the accelerometer read after the load's step."""
    time_s = (np.arange(window.readings.shape[-1]) + 0.5) * float(window.block_s)
    readings, weight = np.asarray(window.readings)[0], np.asarray(window.weight)[0]
    free = (time_s > float(unknowns.start_s + unknowns.rise_s)) & (weight > 0)
    if window.rolling is not None:
        return np.nan, np.nan
    try:
        decay = ring_down(time_s[free], readings[free], float(1 / np.median(weight[free])), float(unknowns.m_kg))
    except ValueError:
        return np.nan, np.nan
    return decay.k_kN_per_mm, decay.c_kN_s_per_mm


def read_parts(parts: Sequence[Path]) -> pd.DataFrame:
    """Return the rows of parts, with all columns."""
    return pd.concat([pd.read_parquet(part) for part in parts], ignore_index=True)


def estimates_of(table: pd.DataFrame, law: MotionLaw = FANCHER) -> tuple[pd.DataFrame, Motions]:
    """Return the rows of `estimates.csv` that parts hold (`read_parts`), and the same as the hierarchy takes them."""
    arrays = {name: np.stack(table[name].tolist()) for name in (ROWS, TARGET, MEAN, VARIANCE)}
    factors = table[["record", *FACTORS]].copy()
    rows = arrays[ROWS].reshape(len(table), *2 * (len(law.parameters),))
    readings = Readings(table[CONSTANT].to_numpy(float), table[EFFECTIVE].to_numpy(float))
    motions = Motions(factors, rows, arrays[TARGET], arrays[MEAN], arrays[VARIANCE], law, readings)
    return table[columns(law)], motions


def shown_motions(parts: Sequence[Path]) -> pd.DataFrame | None:
    """Return the readings of a few records that parts hold: `ROW_COLUMNS`, `shown` (a place), and `COLUMNS`.

    None where an earlier version wrote the parts, without readings.
    """
    try:
        records = pd.concat(
            [pd.read_parquet(part, columns=[*ROW_COLUMNS, MISFIT]) for part in parts], ignore_index=True
        )
        shown = places((records["status"] == OK).to_numpy(), records[MISFIT].to_numpy(float))
        readings_at = {
            place: pd.read_parquet(parts[i], columns=[READINGS])[READINGS].iloc[0] for place, i in shown.items()
        }
    except (KeyError, ValueError):
        return None
    blocks = []
    for place, flat in readings_at.items():
        readings = pd.DataFrame(np.reshape(flat, (-1, len(COLUMNS))), columns=list(COLUMNS))
        readings = readings.assign(shown=place, **{name: records[name].iloc[shown[place]] for name in ROW_COLUMNS})
        blocks.append(readings[["record", "configuration", "shown", *COLUMNS, "status", "origin"]])
    return pd.concat(blocks, ignore_index=True)
