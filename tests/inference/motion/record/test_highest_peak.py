"""The highest peak of a posterior: found beside a lower one, and nothing more to find where rig and tyre are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mismatched_motions import simulated, simulated_on

from bayes_tyre.inference.motion.record import window_fit
from bayes_tyre.inference.motion.record.highest_peak import HIGHER, drawn_about_highest_peak
from bayes_tyre.inference.motion.record.importance_sampling import DRAWS
from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.window import make_window
from bayes_tyre.inference.motion.record.window_fit import fit_window
from bayes_tyre.studies.motion_machine import Machine

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled")]


def test_draws_lead_to_a_higher_peak_where_the_load_rings_and_no_model_says_so(monkeypatch):
    monkeypatch.setattr(window_fit, "_with_ringing", lambda *of: of[-1])
    truth, rig, recorded = simulated("overshoot 6 % at 18 Hz", 3)
    fit = fit_window(rig, make_window(rig, recorded))
    found, draws = drawn_about_highest_peak(rig, fit)
    log_density = jax.jit(lambda at: -0.5 * jnp.sum(residuals(rig, at, fit.window) ** 2))
    below, above = (float(log_density(jnp.asarray(each.estimate.standard))) for each in (fit, found))
    assert fit.estimate.converged
    assert above > below + HIGHER
    assert draws.trusted
    # Of a normal error one in 370 is beyond three standard deviations.
    k = found.window.in_units(rig, jnp.asarray(draws.weights @ draws.standard)).law.k
    assert np.log(float(k)) == pytest.approx(np.log(truth.k_kN_per_mm), abs=0.04)


def test_draws_about_the_only_peak_stay_there():
    _, rig, recorded = simulated_on(Machine(), 0)
    fit = fit_window(rig, make_window(rig, recorded))
    found, draws = drawn_about_highest_peak(rig, fit)
    assert found is fit
    assert draws.trusted
    assert len(draws.weights) == DRAWS
