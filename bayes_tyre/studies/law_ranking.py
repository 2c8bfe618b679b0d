"""Ranking of force laws on simulated records of known law, each fitted with every law, by `compare`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut
from bayes_tyre.inference.motion.hierarchy.leave_one_out import leave_one_motion_out, with_motions
from bayes_tyre.inference.motion.hierarchy.model import Motions, Readings, fit_motions
from bayes_tyre.inference.motion.laws import MOTION_LAWS, MotionLaw, motion_law
from bayes_tyre.inference.motion.record.estimate import MotionEstimate, estimate_motion
from bayes_tyre.inference.motion.record.evidence import log_constant
from bayes_tyre.inference.motion.record.likelihood import hierarchy_moments, likelihood_of
from bayes_tyre.inference.motion.record.model.forward_model import axle_kg
from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.laws.base import StatefulLaw
from bayes_tyre.record import FACTORS
from bayes_tyre.results.comparison.model_comparison import STANDARD_ERRORS, compare
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.process import prepare
from bayes_tyre.simulate.draw import draw_truth, stream
from bayes_tyre.simulate.plan import Planned, quick_plan
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.simulate.truth import Truth
from bayes_tyre.studies.motion_study import ORIGIN

#: Laws that contain another, exactly or as a limit: on its records they may rank equal.
CONTAINS: dict[str, tuple[str, ...]] = {
    "fancher": ("bouc_wen",),
    "kelvin_voigt": ("fancher", "bouc_wen", "maxwell_slip", "rigid_ring"),
}
#: Parameters that a simulated truth does not have: a Bouc-Wen n far from Fancher's 1, the belt of a truck tyre.
EXTRA_PARAMETERS = {"n": 2.0, "belt_frequency": 55.0, "belt_damping": 0.05, "sidewall_ratio": 4.0}
#: Laws that are told apart: those that neither extend Fancher's nor average over others.
RANKED_LAWS = tuple(name for name, law in MOTION_LAWS.items() if not (law.extensions or law.averaged))
CONFIGURATION = "single"
#: Sampler settings of the hierarchical fits and of the refits where importance sampling fails. The acceptance is that
#: of any fit of motions: to name it spares fits by a wrong law their repeat where they diverge.
SAMPLER = SamplerSettings(chains=2, warmup=300, draws=300, target_accept=CAREFUL_ACCEPTANCE)


class Ranked(NamedTuple):
    """Result of the study: a row a true and a fitted law; and a row a true law, a fitted law and a record."""

    table: pd.DataFrame
    records: pd.DataFrame


def planned(records: int) -> list[Planned]:
    """Return plans of stationary records: repeats of unloading from 30 kN and of loading from 20 kN, in turn."""
    ends = (("unloading", 30.0), ("loading", 20.0))
    plans = [plan for plan in quick_plan() if plan.case.configuration == CONFIGURATION]
    cases = [[p for p in plans if (p.case.direction, p.case.initial_load_kN) == end] for end in ends]
    in_turn = [plan for repeat in zip(*cases, strict=True) for plan in repeat]
    if records > len(in_turn):
        raise BadInput(f"{records} records are asked for; there are {len(in_turn)}")
    return [plan._replace(duration_s=2.5, step_between_s=(1.0, 1.1)) for plan in in_turn[:records]]


def simulated(law: MotionLaw, plan: Planned, rig: Rig, seed: int) -> Recorded:
    """Return a record of a plan simulated with a law; load, axle and noise are the same with every law."""
    truth = draw_truth(plan, rig, seed)
    tyre = _law_of(law, truth)
    # A law without friction rests on its line.
    rest = truth.rest_friction_kN if law.has_friction else 0.0
    truth = replace(truth, m_kg=float(axle_kg(rig, tyre, truth.m_kg)), rest_friction_kN=rest)
    raw = simulate_record(truth, rig, tyre).raw
    return Recorded(*prepare(raw, rig, RecordFactors(plan.record, plan.case, plan.repeat)).for_motion())


def _law_of(law: MotionLaw, truth: Truth) -> StatefulLaw:
    k, x, beta = truth.k_kN_per_mm, truth.x_kN, truth.beta_mm
    values = {"k": k, "x": x, "settled": x - k * beta, "beta": beta, **EXTRA_PARAMETERS}
    return law.law(**{name: values[name] for name in law.reported}, C=truth.C_kN)


def rank_laws(
    true_laws: Sequence[str],
    laws: Sequence[str] = RANKED_LAWS,
    records: int = 4,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda _: None,
) -> Ranked:
    """Return how laws rank on records simulated with each of the true ones.

    Parameters
    ----------
    true_laws, laws:
        Names of laws to simulate with, and to fit.
    records:
        Of each true law.
    seed:
        Of tyres, axles and noise.
    on_progress:
        Called with 1 after each law fitted to the records of a true one.

    Raises
    ------
    BadInput
        For an unknown law, or more records than there are.
    """
    rig, plans = load_rig(CONFIGURATION), planned(records)
    of_seed = int(stream(seed, "law ranking").integers(2**32))
    tables, estimates = [], []
    for true in true_laws:
        recordings = [simulated(motion_law(true), plan, rig, of_seed) for plan in plans]
        by_law: dict[str, LeaveOneOut] = {}
        for name in laws:
            # Without NUTS: it would take hours, and most laws are not the true one.
            each = [estimate_motion(rig, record, motion_law(name), sampler=None) for record in recordings]
            by_law[name] = _left_out(rig, plans, each, motion_law(name))
            for plan, estimate, elpd in zip(plans, each, by_law[name].elpd.elpd_i.to_numpy(), strict=True):
                estimates.append(_estimate_row(true, name, plan, estimate, float(elpd)))
            on_progress(1)
        tables.append(_ranks(true, by_law, pd.DataFrame(estimates)))
    return Ranked(pd.concat(tables, ignore_index=True), pd.DataFrame(estimates))


def _left_out(rig: Rig, plans: list[Planned], estimates: list[MotionEstimate], law: MotionLaw) -> LeaveOneOut:
    motions = _motions(rig, plans, estimates, law)
    return leave_one_motion_out(with_motions(fit_motions(motions, SAMPLER), motions), SAMPLER)


def _motions(rig: Rig, plans: list[Planned], estimates: list[MotionEstimate], law: MotionLaw) -> Motions:
    """Return the estimates as input of the hierarchical model."""
    rows = []
    for estimate in estimates:
        moments = estimate.log_mean, estimate.log_covariance
        prior = np.asarray(estimate.window.prior)
        likelihood = likelihood_of(rig, *moments, prior, trusted=not estimate.status, law=law)
        constant = log_constant(rig, likelihood, prior, estimate.log_evidence)
        mean, covariance = hierarchy_moments(*moments, law)
        rows.append((*likelihood, mean, np.diag(covariance), constant, estimate.effective_draws))
    directions, target, mean, variance, constant, effective = map(np.array, zip(*rows, strict=True))
    factors = pd.DataFrame([{"record": p.record, **p.case._asdict(), "repeat": p.repeat} for p in plans])
    return Motions(
        factors[["record", *FACTORS]], directions, target, mean, variance, law, Readings(constant, effective)
    )


def _estimate_row(true: str, fitted: str, plan: Planned, estimate: MotionEstimate, elpd: float) -> dict[str, Any]:
    squares = estimate.map_estimate.chi_squared
    return {
        **{"true_law": true, "fitted_law": fitted, "record": plan.record, "elpd": elpd},
        **{"log_evidence": estimate.log_evidence, "chi_squared_acceleration": float(squares[0])},
        **{"method": estimate.method, "status": estimate.status or "ok", "origin": ORIGIN},
    }


def _ranks(true: str, by_law: dict[str, LeaveOneOut], estimates: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a true law: those of `compare`, and which laws may rank first."""
    table = compare(by_law, dict.fromkeys(by_law, "pass")).rename(columns={"model": "fitted_law"})
    not_ok = estimates[(estimates["true_law"] == true) & (estimates["status"] != "ok")]
    doubted = not_ok.groupby("fitted_law").size()
    wanted = table["fitted_law"].isin((true, *CONTAINS.get(true, ())))
    within = table["elpd_difference"].abs() <= STANDARD_ERRORS * table["difference_se"].fillna(0.0)
    table.insert(0, "true_law", true)
    return table[
        ["true_law", "fitted_law", "rank", "elpd", "elpd_difference", "difference_se", "records", "pareto_k_max"]
    ].assign(
        doubted=[int(doubted.get(name, 0)) for name in table["fitted_law"]],
        is_or_contains=wanted,
        first_within_2_se=within | (table["rank"] == 1),
        origin=ORIGIN,
    )


def ranked_correctly(table: pd.DataFrame) -> pd.Series:
    """Return by true law whether it, or a law that contains it, ranks first within two standard errors."""
    good = table["is_or_contains"] & table["first_within_2_se"]
    return good.groupby(table["true_law"], sort=False).any()


def sentences(table: pd.DataFrame) -> list[str]:
    """Return a line a true law: the fitted laws by rank, with their difference from the first in log density."""
    right, lines = ranked_correctly(table), []
    for true, rows in table.groupby("true_law", sort=False):
        others = [
            f"{row.fitted_law} ({row.elpd_difference:.1f} ± {row.difference_se:.1f})"
            for row in rows.iloc[1:].itertuples(index=False)
        ]
        verdict = "" if right[true] else "; it should be first within two standard errors, or a law that contains it"
        lines.append(f"records of {true}: {rows.iloc[0]['fitted_law']} first, then {', '.join(others)}{verdict}")
    return lines
