"""Every law of a motion: built from its parameters, its priors, its names and units in the hierarchy."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.motion.laws import EXTENSIONS, FANCHER, MOTION_LAWS, TYRE_PRIORS, motion_law
from bayes_tyre.inference.motion.record.model.parameters import RECORD_PRIORS, in_units, parameter_names, prior_moments
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.record import LAW_PARAMETERS, RECORD_UNITS
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.motion_step import wheel_centre_per_flat

RIG = load_rig("single")
every_law = pytest.mark.parametrize("law", MOTION_LAWS.values(), ids=MOTION_LAWS.keys())
LEVEL_NAMES = ("acceleration_offset_m_per_s2", "laser_at_rest_mm", "load_before_kN", "load_after_kN")
RECORD_LEVELS = dict.fromkeys(LEVEL_NAMES, (1.0, 1.0)) | {"ramp_start_s": (0.05, np.nan), "log_rise": (-3.0, np.nan)}


@every_law
def test_parameters_make_the_law_with_their_values(law):
    names, prior = parameter_names(law), prior_moments(RIG, RECORD_LEVELS, law)
    assert names == (*(f"log_{name}" for name in law.tyre_parameters), *RECORD_PRIORS, *law.extensions)
    standard = np.random.default_rng(0).standard_normal(len(names))
    parameters = in_units(RIG, jnp.asarray(standard), prior, law=law)
    value = dict(zip(names, prior[0] + prior[1] * standard, strict=True))
    for name in set(law.tyre_parameters) & set(law.reported):
        assert getattr(parameters.law, name) == pytest.approx(np.exp(value[f"log_{name}"]), rel=1e-12)
        assert (value[f"log_{name}"] - TYRE_PRIORS[name].mean) / TYRE_PRIORS[name].sd == pytest.approx(
            standard[names.index(f"log_{name}")], rel=1e-9
        )
    assert pytest.approx(value["C_kN"]) == parameters.law.C
    assert parameters.m_kg == pytest.approx(np.exp(value["log_m"]))
    assert (parameters.rest_friction_kN == 0) == (not law.has_friction)
    if "relaxing_share" not in law.extensions:  # below 0 there, which noise makes of none, it would make energy
        parameters.law.check()


@every_law
def test_reported_parameters_make_the_same_law(law):
    logs = jnp.array([TYRE_PRIORS[name].mean for name in law.tyre_parameters]) + 0.3
    made = law.from_logs(logs, 0.2)
    reported = law.from_reported(jnp.stack([jnp.asarray(getattr(made, name)) for name in law.reported]), 0.2)
    for one, other in zip(jax.tree.leaves(made), jax.tree.leaves(reported), strict=True):
        assert one == pytest.approx(float(other), rel=1e-14)


@pytest.mark.parametrize("law", [law for law in MOTION_LAWS.values() if law.extensions], ids=lambda law: law.name)
def test_an_extended_law_has_its_extensions_and_ends_where_it_rests(law):
    names, prior = parameter_names(law), prior_moments(RIG, RECORD_LEVELS | {"load_before_kN": (8.0, 1.0)}, law)
    standard = np.random.default_rng(1).standard_normal(len(names))
    parameters = in_units(RIG, jnp.asarray(standard), prior, law=law)
    for name in law.extensions:
        at = names.index(name)
        value = EXTENSIONS[name].value(jnp.asarray(prior[0, at] + prior[1, at] * standard[at]))
        assert getattr(parameters.law, name) == pytest.approx(float(value), rel=1e-12)
    # A rest before the step: the middle line and the friction there carry the load, however the line bends.
    before = parameters.law.ends_mm[0]
    line = float(parameters.law.middle_line(before) + parameters.rest_friction_kN)
    at_wheel_centre: Any = brentq(lambda d: float(geometry.flat_ground_displacement(RIG, d) - before), -50.0, 100.0)
    applied = geometry.tyre_load(RIG, parameters.load_kN[0])
    assert line * float(wheel_centre_per_flat(RIG, at_wheel_centre)) == pytest.approx(float(applied), rel=1e-9)


def test_extensions_have_the_ranges_that_their_priors_state():
    ranges = {
        name: [float(one.value(jnp.asarray(one.prior.mean + side * 1.96 * one.prior.sd))) for side in (-1, 1)]
        for name, one in EXTENSIONS.items()
    }
    stated = {
        **{"relaxing_share": (-0.1, 0.1), "relaxation_s": (0.002, 0.032), "friction_change": (-0.2, 0.2)},
        **{"friction_speed_mm_per_s": (8, 120), "growth_per_mm": (-0.06, 0.06), "yield_spread": (0.05, 0.7)},
    }
    for name, range_ in ranges.items():
        assert range_ == pytest.approx(stated[name], rel=0.05)


def test_the_average_is_over_fanchers_law_and_all_that_extend_it():
    extended = [name for name, law in MOTION_LAWS.items() if law.extensions]
    assert MOTION_LAWS["auto"].averaged == ("fancher", *extended)
    assert sorted(name for law in MOTION_LAWS.values() for name in law.extensions) == sorted(EXTENSIONS)


def test_fanchers_parameters_and_their_order():
    assert parameter_names(FANCHER)[:5] == ("log_k", "log_settled", "log_beta", "log_m", "log_damping_ratio")
    assert FANCHER.reported_parameters == ("k", "x", "beta", "m", "c")
    assert next(iter(MOTION_LAWS.values())) is FANCHER


@every_law
def test_a_law_goes_where_arrays_go_and_has_no_leaves(law):
    assert jax.tree.leaves(law) == []
    assert jax.jit(lambda law: len(law.reported) * jnp.ones(()))(law) == len(law.reported)


@every_law
def test_the_hierarchy_has_a_prior_a_name_and_a_unit_for_every_parameter(law):
    for name in law.parameters:
        assert {f"{name}_group", f"sd_log_{name}_case", f"sd_log_{name}_repeat"} <= set(PRIORS)
        assert {name, f"{name}_case", f"{name}_group"} <= set(QUANTITIES)
        assert name in RECORD_UNITS
    assert {*law.tyre_parameters, *law.reported} <= set(LAW_PARAMETERS)


def test_an_unknown_law_is_refused_with_a_list():
    with pytest.raises(BadInput, match="kelvin_voigt, bouc_wen"):
        motion_law("spring")
