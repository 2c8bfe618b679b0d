"""Motions whose estimates and draws are put there: all that `motion` writes of them is real, and quick."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import quiet

from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import MOTION_PARAMETERS
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.inference.motion.laws import motion_law
from bayes_tyre.inference.sampling.datatree import to_datatree
from bayes_tyre.workflow.execution.outcome import Done
from bayes_tyre.workflow.raw import motion, motion_estimates
from bayes_tyre.workflow.raw.estimate_columns import LawRow, Posterior, parameter_columns
from bayes_tyre.workflow.raw.process_tasks import Task
from bayes_tyre.workflow.raw.raw_records import usable

TYPICAL = np.array([1.8, 0.2, 0.08, 285.0, 0.0015])


def estimated(task: Task) -> Done:
    """Return the row of an estimate that a file might have."""
    factor_table, _ = usable(task)
    k, settled, beta, m, c = TYPICAL
    values = dict(zip(parameter_columns(), (k, settled + k * beta, beta, m, c), strict=True))
    statistics = {
        "displacement_mm": 10.0,
        "displacement_delay_ms": 0.0,
        "load_delay_ms": 0.0,
        "second_mode_Hz": np.nan,
        "second_mode_share": np.nan,
        "load_ringing_Hz": np.nan,
        "discrepancy_kN": 0.0,
        "discrepancy_percent": 0.0,
        "load_departure_percent": 0.0,
        "method": "importance",
        "pareto_k": 0.1,
        "status": "ok",
        "origin": "simulated",
    }
    statistics |= {"log_evidence": 5000.0, "log_constant": 5000.0, "effective_draws": 300.0}
    arrays = {"likelihood_rows": 100 * np.eye(5), "likelihood_target": 100 * np.log(TYPICAL)}
    arrays |= {"log_mean": np.log(TYPICAL), "log_variance": np.full(5, 1e-4)}
    flat = {name: array.ravel().tolist() for name, array in arrays.items()}
    if averaged := motion_law(task.method.removeprefix(motion_estimates.BY_LAW)).averaged:
        statistics |= {f"weight_{name}": float(name == "relaxing") for name in averaged}
        statistics |= {f"log_evidence_{name}": 4990.0 + 10.0 * (name == "relaxing") for name in averaged}
        flat["law_rows"] = [law_row(name, statistics).kept() for name in averaged]
    errors = {f"{name}_se": 0.01 * value for name, value in values.items()}
    errors |= {f"{name}_se_without_force": errors[f"{name}_se"] for name in ("k_kN_per_mm", "x_kN", "beta_mm")}
    return Done(pd.DataFrame([{**factor_table.row(), **values, **errors, **statistics, **flat}]))


def law_row(name: str, statistics: dict[str, Any]) -> LawRow:
    """Return what is kept of a record's fit by one law: of the relaxing one k is 5 % above the others'."""
    k, settled, beta, m, c = TYPICAL * [1.05 if name == "relaxing" else 1.0, 1.0, 1.0, 1.0, 1.0]
    prior = np.array([[0.0, np.log(0.2), np.log(0.1), np.log(285.0), np.log(0.05)], np.ones(5)])
    moments = np.log([k, settled + k * beta, beta, m, c]), 1e-4 * np.eye(5), np.ones(5)
    columns = {key: statistics[key] for key in ("displacement_mm", "method", "pareto_k", "effective_draws")}
    return LawRow(name, Posterior(*moments, statistics[f"log_evidence_{name}"], "", prior), columns)


def drawn(motions: Motions, *_: object, **__: object) -> xr.DataTree:
    """Return well-mixed draws of records, cases and groups."""
    rng, factors = np.random.default_rng(0), find_factors(motions.factor_table)
    draws: dict[str, np.ndarray] = {}
    for ending, units in (
        ("", len(motions.factor_table)),
        ("_case", len(factors.cases)),
        ("_group", len(factors.group.labels)),
    ):
        values = TYPICAL * np.exp(0.03 * rng.standard_normal((4, 250, units, len(TYPICAL))))
        draws |= {f"{name}{ending}": values[..., i] for i, name in enumerate(MOTION_PARAMETERS)}
        draws[f"x{ending}"] = values[..., 1] + values[..., 0] * values[..., 2]
    draws["sd_log_k_repeat"] = 0.01 * np.exp(0.1 * rng.standard_normal((4, 250)))
    return to_datatree(draws, quiet(4, 250), factors, motions.factor_table, {"model": "motion", "repeats": "mixture"})


def put_draws_for_the_motions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_estimates, "_done", estimated)
    monkeypatch.setattr(motion, "fit_motions", drawn)
