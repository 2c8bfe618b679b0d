"""The columns of `estimates.csv` and of its parts: a record's posterior and its fit, by each law of an average."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.motion.laws import FANCHER, KELVIN_VOIGT, MotionLaw
from bayes_tyre.inference.motion.record.disturbance.force_discrepancy import load_step_kN
from bayes_tyre.inference.motion.record.estimate import MotionEstimate
from bayes_tyre.inference.motion.record.evidence import log_constant
from bayes_tyre.inference.motion.record.likelihood import hierarchy_moments, likelihood_of
from bayes_tyre.inference.motion.record.model.parameters import MotionParameters
from bayes_tyre.record import FACTORS, parameter_column
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import rest_displacement

#: Spring and damper from the free vibration after the load's step, beside those fitted to the whole motion.
BY_DECAY = ("decay_k_kN_per_mm", "decay_c_kN_s_per_mm")
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
#: Frequency of a load that rings after its step, of a record whose load does.
RINGING_HZ = "load_ringing_Hz"
OK = "ok"
#: Before the name of a law, in the columns of an average over laws: how probable the record makes it, and its evidence.
WEIGHT, LOG_EVIDENCE = "weight_", "log_evidence_"
# Further columns of a part: the likelihood of the hierarchy's log parameters, flattened.
ROWS, TARGET, MEAN, VARIANCE = "likelihood_rows", "likelihood_target", "log_mean", "log_variance"
CONSTANT, EFFECTIVE = "log_constant", "effective_draws"
#: Of an average: what is kept of the record's fit by each law, for other weights (`LawRow`).
LAW_ROWS = "law_rows"


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
    that they show, `load_ringing_Hz` the frequency of a load that rings, empty where there is none; `log_evidence` is
    the log density of the readings under the law, by which laws may be compared record by record.
    `..._se_without_force` are standard errors of the tyre's parameters if it
    were certain that load and law leave out no force. A spring and a damper have two more, at the wheel centre: their
    classic estimate from the free vibration (`rig.motion_decay`), empty where the tyre rolls or hardly vibrates. A law
    that extends Fancher's has its extensions, at the most probable parameters; an average over laws their weights by
    the record itself, and the evidence of those that have a posterior.
    """
    values = [column for name in (*parameter_columns(law), *law.extensions) for column in (name, f"{name}_se")]
    values += [f"{prefix}{name}" for prefix in (WEIGHT, LOG_EVIDENCE) for name in law.averaged]
    values += BY_DECAY if law is KELVIN_VOIGT else ()
    statistics = [
        "displacement_mm",
        *_DELAYS,
        MODE_HZ,
        _MODE_SHARE,
        RINGING_HZ,
        *_LEFT_OUT,
        *_without_force(law),
        "method",
        "pareto_k",
        "log_evidence",
        "status",
        "origin",
    ]
    return ["record", *FACTORS, *values, *statistics]


class Posterior(NamedTuple):
    """A record's posterior, as its columns need it.

    Attributes
    ----------
    log_mean, log_covariance, narrower_without_force, log_evidence, status:
        As `MotionEstimate` has them.
    prior:
        Means and standard deviations of the priors of the fit, of the law's `parameters` at least.
    """

    log_mean: Float[np.ndarray, " p"]
    log_covariance: Float[np.ndarray, "p p"]
    narrower_without_force: Float[np.ndarray, " p"]
    log_evidence: float
    status: str
    prior: Float[np.ndarray, "2 parameters"]


def posterior_of(estimate: MotionEstimate) -> Posterior:
    """Return the posterior of a record that was fitted."""
    moments = estimate.log_mean, estimate.log_covariance, estimate.narrower_without_force
    return Posterior(*moments, estimate.log_evidence, estimate.status, np.asarray(estimate.window.prior))


def posterior_columns(rig: Rig, posterior: Posterior, law: MotionLaw) -> dict[str, Any]:
    """Return the columns that follow from a record's posterior, with the hierarchy's.

    Raises
    ------
    BadInput
        If the posterior has no covariance, or x is not above k beta.
    """
    moments = posterior.log_mean, posterior.log_covariance
    values, sd = np.exp(posterior.log_mean), np.sqrt(np.diag(posterior.log_covariance))
    row: dict[str, Any] = {}
    for name, value, of_log in zip(parameter_columns(law), values, sd, strict=True):
        row |= {name: float(value), f"{name}_se": float(value * of_log)}
    unforced = (values * sd * posterior.narrower_without_force)[: len(law.reported)]
    row |= dict(zip(_without_force(law), unforced.tolist(), strict=True))
    row |= {"status": posterior.status or OK, "log_evidence": posterior.log_evidence}
    likelihood = likelihood_of(rig, *moments, posterior.prior, trusted=not posterior.status, law=law)
    row[CONSTANT] = log_constant(rig, likelihood, posterior.prior, posterior.log_evidence)
    mean, covariance = hierarchy_moments(*moments, law)
    arrays = {ROWS: likelihood.rows, TARGET: likelihood.target, MEAN: mean, VARIANCE: np.diag(covariance)}
    return row | {name: array.ravel().tolist() for name, array in arrays.items()}


def fit_columns(rig: Rig, estimate: MotionEstimate, unknowns: MotionParameters) -> dict[str, Any]:
    """Return the columns of what was fitted beside the posterior, and how."""
    applied = geometry.tyre_load(rig, unknowns.load_kN.mean())
    middle = rest_displacement(rig, applied, k=estimate.value[0], offset_kN=unknowns.law.C)
    row: dict[str, Any] = {"displacement_mm": float(middle)}
    delays_s = unknowns.laser_delay_s, unknowns.load_delay_s
    row |= {name: 1e3 * float(delay_s) for name, delay_s in zip(_DELAYS, delays_s, strict=True)}
    mode = (np.nan, np.nan) if unknowns.mode is None else (unknowns.mode.frequency_Hz, unknowns.mode.share)
    row |= {MODE_HZ: float(mode[0]), _MODE_SHARE: float(mode[1])}
    row[RINGING_HZ] = np.nan if unknowns.ringing is None else float(unknowns.ringing.frequency_Hz)
    share = estimate.discrepancy_share
    left_out = share * float(load_step_kN(rig, unknowns)), 100 * share, 100 * estimate.load_departure_share
    row |= dict(zip(_LEFT_OUT, left_out, strict=True))
    return row | {
        "method": estimate.method,
        "pareto_k": float(estimate.pareto_k),
        EFFECTIVE: float(estimate.effective_draws),
    }


class LawRow(NamedTuple):
    """What is kept of a record's fit by one law of an average."""

    law: str
    posterior: Posterior
    columns: dict[str, Any]

    def kept(self) -> dict[str, Any]:
        """Return it as a cell of a part holds it: numbers, texts and flat lists."""
        values = {
            name: value.ravel().tolist() if isinstance(value, np.ndarray) else value
            for name, value in self.posterior._asdict().items()
        }
        return {"law": self.law, **values, "columns": self.columns}

    @classmethod
    def read(cls, kept: dict[str, Any]) -> "LawRow":
        """Return it from what `kept` made."""
        p = len(kept["log_mean"])
        shapes = {"log_mean": (p,), "log_covariance": (p, p), "narrower_without_force": (p,), "prior": (2, p)}
        values = {name: kept[name] for name in Posterior._fields}
        values |= {name: np.reshape(values[name], shape).astype(float) for name, shape in shapes.items()}
        return cls(kept["law"], Posterior(**values), kept["columns"])


def law_row(rig: Rig, name: str, estimate: MotionEstimate) -> LawRow:
    """Return what is kept of a record's estimate by one law of an average, of this name."""
    unknowns = estimate.window.in_units(rig, jnp.asarray(estimate.map_estimate.standard))
    posterior = posterior_of(estimate)
    shortened = posterior._replace(prior=posterior.prior[:, : len(posterior.log_mean)])
    return LawRow(name, shortened, fit_columns(rig, estimate, unknowns))
