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
from bayes_tyre.inference.motion.record.disturbance.force_discrepancy import load_step_kN
from bayes_tyre.inference.motion.record.estimate import MotionEstimate
from bayes_tyre.inference.motion.record.evidence import log_constant
from bayes_tyre.inference.motion.record.law_average import converged_estimate
from bayes_tyre.inference.motion.record.likelihood import hierarchy_moments, likelihood_of
from bayes_tyre.inference.motion.record.map_fit import CORRELATION_MOST, MISFIT_MOST, MapEstimate
from bayes_tyre.inference.motion.record.model.forward_model import predicted, residuals
from bayes_tyre.inference.motion.record.model.parameters import MotionParameters, parameter_names
from bayes_tyre.inference.motion.record.model.window import Recorded, Window
from bayes_tyre.record import FACTORS, parameter_column
from bayes_tyre.results.figure_data.motion_traces import COLUMNS, places, readings_table
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import rest_displacement
from bayes_tyre.rig.motion_decay import ring_down
from bayes_tyre.rig.sensors import columns_of
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals.process import prepare
from bayes_tyre.workflow.execution.outcome import Done, Fault, attempted
from bayes_tyre.workflow.raw.process_tasks import Task
from bayes_tyre.workflow.raw.raw_records import origin_of_raw, usable

#: Spring and damper from the free vibration after the load's step, beside those fitted to the whole motion.
_BY_DECAY = ("decay_k_kN_per_mm", "decay_c_kN_s_per_mm")
#: Standard deviation of the force that load and law leave out, in per cent of the load's step.
FORCE_PERCENT = "discrepancy_percent"
#: What the model leaves out: that force in kN, in per cent, and the load's departure from its shape in per cent.
_LEFT_OUT = ("discrepancy_kN", FORCE_PERCENT, "load_departure_percent")
#: Ends the columns of the standard errors of the tyre's parameters if it were certain that no force is left out.
WITHOUT_FORCE = "_se_without_force"
#: How late the sensors read, behind the accelerometer.
_DELAYS = ("displacement_delay_ms", "load_delay_ms")
#: A second mode of the rig, of a record that shows one: frequency, and share of the axle's movement that drives it.
MODE_HZ, _MODE_SHARE = "second_mode_Hz", "second_mode_share"
OK = "ok"
#: Before the name of a law, in the columns of an average over laws: how probable the record makes it.
WEIGHT = "weight_"
#: Before the name of the law in the method that a task names.
BY_LAW = "motion on "
# Further columns of a part: the likelihood of the hierarchy's log parameters, flattened.
_ROWS, _TARGET, _MEAN, _VARIANCE = "likelihood_rows", "likelihood_target", "log_mean", "log_variance"
_CONSTANT, _EFFECTIVE = "log_constant", "effective_draws"
#: For the figures of a few motions: misfit, as a share of the limit of its check; the table of readings, flattened;
#: and the columns shown with it.
MISFIT, READINGS, ROW_COLUMNS = "misfit", "readings", ("record", "configuration", "status", "origin")


def parameter_columns(law: MotionLaw = FANCHER) -> tuple[str, ...]:
    """Return the columns of a law's `reported_parameters`, in their order; a standard error stands behind each."""
    return tuple(parameter_column(name) for name in law.reported_parameters)


def _without_force(law: MotionLaw) -> list[str]:
    """Return the columns of standard errors of the tyre's own parameters, were no force left out."""
    return [f"{parameter_column(name)}{WITHOUT_FORCE}" for name in law.reported]


def columns(law: MotionLaw) -> list[str]:
    """Return the columns of `estimates.csv`.

    `displacement_mm` is the middle of the step at the wheel centre, which a cycle goes about; `displacement_delay_ms`
    and `load_delay_ms` are how late the sensors read, `second_mode_Hz` and `second_mode_share` a second mode of the rig
    that they show, empty where there is none; `log_evidence` is the log density of the readings under the law, by which
    laws may be compared record by record. `..._se_without_force` are standard errors of the tyre's parameters if it
    were certain that load and law leave out no force. A spring and a damper have two more, at the wheel centre: their
    classic estimate from the free vibration (`rig.motion_decay`), empty where the tyre rolls or hardly vibrates. A law
    that extends Fancher's has its extensions, at the most probable parameters; an average over laws their weights.
    """
    values = [column for name in (*parameter_columns(law), *law.extensions) for column in (name, f"{name}_se")]
    values += [f"{WEIGHT}{name}" for name in law.averaged]
    values += _BY_DECAY if law is KELVIN_VOIGT else ()
    statistics = [
        "displacement_mm",
        *_DELAYS,
        MODE_HZ,
        _MODE_SHARE,
        *_LEFT_OUT,
        *_without_force(law),
        "method",
        "pareto_k",
        "log_evidence",
        "status",
        "origin",
    ]
    return ["record", *FACTORS, *values, *statistics]


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
    values, sd, law = estimate.value, np.sqrt(np.diag(estimate.log_covariance)), estimate.window.law
    row: dict[str, Any] = {}
    for name, value, of_log in zip(parameter_columns(law), values, sd, strict=True):
        row |= {name: float(value), f"{name}_se": float(value * of_log)}
    applied = geometry.tyre_load(rig, unknowns.load_kN.mean())
    row["displacement_mm"] = float(rest_displacement(rig, applied, k=values[0], offset_kN=unknowns.law.C))
    delays_s = unknowns.laser_delay_s, unknowns.load_delay_s
    row |= {name: 1e3 * float(delay_s) for name, delay_s in zip(_DELAYS, delays_s, strict=True)}
    mode = (np.nan, np.nan) if unknowns.mode is None else (unknowns.mode.frequency_Hz, unknowns.mode.share)
    row |= {MODE_HZ: float(mode[0]), _MODE_SHARE: float(mode[1])}
    share = estimate.discrepancy_share
    left_out = share * float(load_step_kN(rig, unknowns)), 100 * share, 100 * estimate.load_departure_share
    row |= dict(zip(_LEFT_OUT, left_out, strict=True))
    unforced = (values * sd * estimate.narrower_without_force)[: len(law.reported)]
    row |= dict(zip(_without_force(law), unforced.tolist(), strict=True))
    row |= _extensions(estimate.window, estimate.map_estimate) | {
        f"{WEIGHT}{name}": weight for name, weight in estimate.law_weights.items()
    }
    row |= {"method": estimate.method, "pareto_k": float(estimate.pareto_k), "status": estimate.status or OK}
    row |= {"log_evidence": estimate.log_evidence, _EFFECTIVE: estimate.effective_draws}
    moments = estimate.log_mean, estimate.log_covariance
    likelihood = likelihood_of(rig, *moments, np.asarray(estimate.window.prior), trusted=not estimate.status, law=law)
    mean, covariance = hierarchy_moments(*moments, law)
    row[_CONSTANT] = log_constant(rig, likelihood, estimate.window, estimate.log_evidence)
    if law is KELVIN_VOIGT:
        row |= dict(zip(_BY_DECAY, _by_decay(estimate.window, unknowns), strict=True))
    arrays = {_ROWS: likelihood.rows, _TARGET: likelihood.target, _MEAN: mean, _VARIANCE: np.diag(covariance)}
    return row | {name: array.ravel().tolist() for name, array in arrays.items()}


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


def read_estimates(parts: list[Path], law: MotionLaw = FANCHER) -> tuple[pd.DataFrame, Motions]:
    """Return the rows of `estimates.csv` that parts hold, and the estimates as the hierarchy takes them."""
    table = pd.concat([pd.read_parquet(part) for part in parts], ignore_index=True)
    arrays = {name: np.stack(table[name].tolist()) for name in (_ROWS, _TARGET, _MEAN, _VARIANCE)}
    factors = table[["record", *FACTORS]].copy()
    rows = arrays[_ROWS].reshape(len(table), *2 * (len(law.parameters),))
    readings = Readings(table[_CONSTANT].to_numpy(float), table[_EFFECTIVE].to_numpy(float))
    motions = Motions(factors, rows, arrays[_TARGET], arrays[_MEAN], arrays[_VARIANCE], law, readings)
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
