"""Every law that a motion can be fitted with: made of its unknowns, found again in a record, told apart by evidence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS, OF_TYRES, motion_law
from bayes_tyre.inference.motion.record.parameters import BEFORE, NAMES, in_units, names_of, priors_of
from bayes_tyre.inference.sampling.datatree import QUANTITIES, RECORD_UNITS
from bayes_tyre.rig.axle import load_rig

RIG = load_rig("single")
every_law = pytest.mark.parametrize("law", MOTION_LAWS.values(), ids=MOTION_LAWS.keys())
LEVELS = ("acceleration_offset_m_per_s2", "laser_at_rest_mm", "load_before_kN", "load_after_kN")
KNOWN = dict.fromkeys(LEVELS, (1.0, 1.0)) | {"ramp_start_s": (0.05, np.nan), "log_rise": (-3.0, np.nan)}


@every_law
def test_unknowns_make_the_law_with_their_values(law):
    names, prior = names_of(law), priors_of(RIG, KNOWN, law)
    assert names == (*(f"log_{name}" for name in law.unknowns), *BEFORE)
    standard = np.random.default_rng(0).standard_normal(len(names))
    unknowns = in_units(RIG, jnp.asarray(standard), prior, law=law)
    value = dict(zip(names, prior[0] + prior[1] * standard, strict=True))
    for name in set(law.unknowns) & set(law.told):
        assert getattr(unknowns.law, name) == pytest.approx(np.exp(value[f"log_{name}"]), rel=1e-12)
        assert (value[f"log_{name}"] - OF_TYRES[name].location) / OF_TYRES[name].scale == pytest.approx(
            standard[names.index(f"log_{name}")], rel=1e-9
        )
    assert pytest.approx(value["C_kN"]) == unknowns.law.C
    assert unknowns.m_kg == pytest.approx(np.exp(value["log_m"]))
    assert (unknowns.rest_friction_kN == 0) == (not law.has_friction)
    unknowns.law.check()


@every_law
def test_what_estimates_tell_makes_the_same_law(law):
    logs = jnp.array([OF_TYRES[name].location for name in law.unknowns]) + 0.3
    made = law.of_logs(logs, 0.2)
    told = law.of_told(jnp.stack([jnp.asarray(getattr(made, name)) for name in law.told]), 0.2)
    for one, other in zip(jax.tree.leaves(made), jax.tree.leaves(told), strict=True):
        assert one == pytest.approx(float(other), rel=1e-14)


def test_fanchers_unknowns_are_what_they_were():
    assert NAMES[:5] == ("log_k", "log_settled", "log_beta", "log_m", "log_damping_ratio")
    assert FANCHER.told_parameters == ("k", "x", "beta", "m", "c")
    assert next(iter(MOTION_LAWS.values())) is FANCHER


@every_law
def test_a_law_goes_where_arrays_go_and_has_no_leaves(law):
    assert jax.tree.leaves(law) == []
    assert jax.jit(lambda law: len(law.told) * jnp.ones(()))(law) == len(law.told)


@every_law
def test_the_hierarchy_has_a_prior_a_name_and_a_unit_for_every_parameter(law):
    for name in law.parameters:
        assert {f"{name}_group", f"sd_log_{name}_case", f"sd_log_{name}_repeat"} <= set(PRIORS)
        assert {name, f"{name}_case", f"{name}_group"} <= set(QUANTITIES)
        assert name in RECORD_UNITS


def test_an_unknown_law_is_refused_with_a_list():
    with pytest.raises(BadInput, match="kelvin_voigt, bouc_wen"):
        motion_law("spring")
