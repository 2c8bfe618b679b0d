"""One contract over every law: what `force`, `init` and `step` promise in bayes_tyre/laws/base.py."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.laws.base import Law, StatefulLaw
from bayes_tyre.laws.envelopes import LinearEnvelope
from bayes_tyre.laws.fancher import Fancher, OneStep, Recursion

LINES = LinearEnvelope(k=1.8, C=10.0, x=0.3)
STATEFUL = {
    "fancher": Fancher(k=1.8, C=10.0, x=0.3, beta=0.05),
    "recursion": Recursion(upper=LINES.upper, lower=LINES.lower, beta=0.05),
}
LAWS = {**STATEFUL, "one step": OneStep(k=1.8, C=10.0, beta=0.05)}
PATH = np.array([0.2, 0.2, 0.3, 1.0, 1.0, 0.9, -0.4, -0.4, 0.1])

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
every_stateful_law = pytest.mark.parametrize("law", STATEFUL.values(), ids=STATEFUL.keys())


@every_law
def test_path_starts_at_its_force(law: Law):
    force = law.force(PATH, 9.7)
    assert force.shape == PATH.shape
    assert force[0] == 9.7
    assert force[1] == 9.7


@every_law
def test_jit_changes_nothing(law: Law):
    np.testing.assert_allclose(jax.jit(lambda path, F: law.force(path, F))(PATH, 9.7), law.force(PATH, 9.7), rtol=1e-14)


@every_law
def test_a_single_point_is_a_path(law: Law):
    np.testing.assert_array_equal(law.force(PATH[:1], 9.7), [9.7])


@every_law
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_dtype_follows_the_inputs(law: Law, dtype):
    assert law.force(PATH.astype(dtype), 9.7).dtype == dtype
    double = jax.tree.map(lambda leaf: leaf if callable(leaf) else jnp.asarray(leaf, np.float64), law)
    assert double.force(PATH.astype(dtype), 9.7).dtype == np.float64


@every_stateful_law
def test_steps_are_the_force_along_the_path(law: StatefulLaw):
    state, forces = law.init(PATH[0], 9.7), []
    for d in PATH:
        state, F = law.step(state, d)
        forces.append(F)
    np.testing.assert_allclose(jnp.stack(forces), law.force(PATH, 9.7), rtol=1e-14)


@every_stateful_law
def test_no_move_changes_nothing(law: StatefulLaw):
    force = np.asarray(law.force(PATH, 9.7))
    stays = np.flatnonzero(np.diff(PATH) == 0)
    np.testing.assert_array_equal(force[stays + 1], force[stays])


@every_law
def test_inputs_are_left_alone(law: Law):
    path = PATH.copy()
    law.force(path, 9.7)
    np.testing.assert_array_equal(path, PATH)
