"""One contract over every law: what `force`, `init` and `step` promise in bayes_tyre/laws/base.py."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.law_in_time import force_in_time
from helpers.moving_axle import DAMPING, RIG, C, M, at_rest, driven, energies

from bayes_tyre.laws.base import StatefulLaw
from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.extended_fancher import ExtendedFancher
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.maxwell_slip import MaxwellSlip
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.rig.motion import Body, Start, move

STATEFUL = {
    "fancher": Fancher(k=1.8, C=10.0, x=0.3, beta=0.05),
    "kelvin_voigt": KelvinVoigt(k=1.8, C=10.0),
    "bouc_wen": BoucWen(k=1.8, C=10.0, settled=0.2, beta=0.05, n=1.5),
    "maxwell_slip": MaxwellSlip(k=1.8, C=10.0, settled=0.2, beta=0.05),
    "rigid_ring": RigidRing(k=1.8, C=10.0, belt_frequency=60.0, belt_damping=0.05, sidewall_ratio=4.0),
    "extended_fancher": ExtendedFancher(
        **{"k": 1.8, "C": 10.0, "x": 0.3, "beta": 0.05, "relaxing_share": 0.08, "relaxation_s": 0.008},
        **{"friction_change": -0.15, "friction_speed_mm_per_s": 30.0, "growth_per_mm": 0.03, "ends_mm": (0.1, 0.9)},
        yield_spread=0.6,
    ),
}
#: How far one move instead of many may be off, kN.
ONE_MOVE_KN = {"fancher": 1e-13, "kelvin_voigt": 1e-13, "bouc_wen": 4e-4 * 0.2, "maxwell_slip": 1e-13}
ONE_MOVE_KN |= {"rigid_ring": 1e-12, "extended_fancher": 1e-13}
#: The laws to which time matters: their force along a path without times is that of a slow one.
OF_TIME = STATEFUL["rigid_ring"], STATEFUL["extended_fancher"]
PATH = np.array([0.2, 0.2, 0.3, 1.0, 1.0, 0.9, -0.4, -0.4, 0.1])

every_law = pytest.mark.parametrize("law", STATEFUL.values(), ids=STATEFUL.keys())
whatever_the_points = pytest.mark.parametrize(
    ("law", "tolerance"), [(STATEFUL[name], most) for name, most in ONE_MOVE_KN.items()], ids=ONE_MOVE_KN.keys()
)


@every_law
def test_path_starts_at_its_force(law: StatefulLaw):
    force = law.force(PATH, 9.7)
    assert force.shape == PATH.shape
    assert force[0] == 9.7
    assert force[1] == 9.7


@every_law
def test_jit_changes_nothing(law: StatefulLaw):
    np.testing.assert_allclose(jax.jit(lambda path, F: law.force(path, F))(PATH, 9.7), law.force(PATH, 9.7), rtol=1e-14)


@every_law
def test_a_single_point_is_a_path(law: StatefulLaw):
    np.testing.assert_array_equal(law.force(PATH[:1], 9.7), [9.7])


@every_law
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_dtype_follows_the_inputs(law: StatefulLaw, dtype):
    assert law.force(PATH.astype(dtype), 9.7).dtype == dtype
    double = jax.tree.map(lambda leaf: leaf if callable(leaf) else jnp.asarray(leaf, np.float64), law)
    assert double.force(PATH.astype(dtype), 9.7).dtype == np.float64


@every_law
def test_steps_are_the_force_along_the_path(law: StatefulLaw):
    state, forces = law.init(PATH[0], 9.7), []
    for d in PATH:
        state, F = law.step(state, d)
        forces.append(F)
    np.testing.assert_allclose(jnp.stack(forces), law.force(PATH, 9.7), rtol=1e-14)


@every_law
def test_no_move_changes_nothing(law: StatefulLaw):
    force = np.asarray(law.force(PATH, 9.7))
    stays = np.flatnonzero(np.diff(PATH) == 0)
    np.testing.assert_array_equal(force[stays + 1], force[stays])


@every_law
def test_inputs_are_left_alone(law: StatefulLaw):
    path = PATH.copy()
    law.force(path, 9.7)
    np.testing.assert_array_equal(path, PATH)


@whatever_the_points
def test_a_move_is_the_same_in_one_step_or_in_many(law: StatefulLaw, tolerance):
    turns = np.array([0.2, 0.23, 0.1, 1.3, 1.25, -0.4, -0.39])
    legs = [np.linspace(start, end, 201)[1:] for start, end in pairwise(turns)]
    many = law.force(np.concatenate([turns[:1], *legs]), 10.4)[::200]
    np.testing.assert_allclose(law.force(turns, 10.4), many, rtol=0, atol=tolerance)


@every_law
def test_a_law_of_displacement_alone_is_the_same_at_any_pace(law: StatefulLaw):
    slow, quick = law.force(PATH, 9.7), force_in_time(law, PATH, 9.7, 1e-3)
    assert bool(jnp.all(quick == slow)) == (not any(law is one for one in OF_TIME))


@every_law
def test_a_move_in_no_time_to_the_same_place_changes_nothing(law: StatefulLaw):
    state, F = law.step_in(law.init(0.2, 9.7), 0.3, 1e-3, 40.0)
    again, same = law.step_in(state, 0.3, 0.0, 40.0)
    assert same == F
    for one, other in zip(jax.tree.leaves(state), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)


@every_law
def test_derivatives_are_those_of_finite_differences(law: StatefulLaw):
    # Off the points where a path turns or an element yields, so that both sides have one derivative.
    path, start = np.array([0.2, 0.23, 0.31, 0.71, 0.64, 0.655]), 10.41
    numbers = [leaf for leaf in jax.tree.leaves(law) if not callable(leaf)]

    def forces(values):
        leaves = iter(values)
        varied = jax.tree.map(lambda leaf: leaf if callable(leaf) else next(leaves), law)
        return varied.force(path, start)

    values = jnp.asarray(numbers)
    exact = np.asarray(jax.jacfwd(forces)(values))
    for i, h in enumerate(1e-6 * np.asarray(numbers)):
        off = jnp.zeros_like(values).at[i].set(h)
        differences = (forces(values + off) - forces(values - off)) / (2 * h)
        # Rounding of forces of 10 kN over 2 h, and h^2.
        np.testing.assert_allclose(exact[:, i], differences, rtol=1e-5, atol=4e-15 / h + 1e-8)


@pytest.mark.parametrize("amplitude", [0.0, 0.3], ids=["standing", "rolling"])
@pytest.mark.parametrize("name", ONE_MOVE_KN)
def test_an_axle_on_it_closes_its_energy_account(name, amplitude):
    law = replace(STATEFUL[name], C=C)
    drive, _ = driven(1000.0, 0.4, amplitude)
    body = Body(law, M, DAMPING)
    found = jax.jit(lambda drive, start: move(RIG, body, drive, start))(drive, Start(at_rest(C)))
    account = energies(body, drive, found)
    closed = abs(account.applied - (account.kinetic + account.tyre + account.damping))
    assert closed < 1e-6 * abs(account.applied)


@pytest.mark.parametrize(
    ("name", "field"),
    [("kelvin_voigt", "k"), ("bouc_wen", "n"), ("maxwell_slip", "settled"), ("rigid_ring", "belt_damping")]
    + [("extended_fancher", field) for field in ("beta", "relaxing_share", "relaxation_s", "yield_spread")],
)
def test_numbers_that_make_energy_or_none_are_refused(name, field):
    law = STATEFUL[name]
    law.check()
    with pytest.raises(ValueError, match=field):
        replace(law, **{field: -0.1}).check()
