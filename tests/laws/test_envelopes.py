"""The envelopes: a table of two lines is those lines, inside and beyond its ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.laws.envelopes import LinearEnvelope, TableEnvelope
from bayes_tyre.laws.fancher import Recursion

LINES = LinearEnvelope(k=1.8, C=10.0, x=0.3)
ROWS = jnp.array([-0.5, 0.1, 0.2, 1.0])
TABLE = TableEnvelope(d=ROWS, F_upper=LINES.upper(ROWS), F_lower=LINES.lower(ROWS))


def test_table_of_lines_is_the_lines():
    d = jnp.linspace(-3.0, 4.0, 71)
    np.testing.assert_allclose(TABLE.upper(d), LINES.upper(d), rtol=1e-13)
    np.testing.assert_allclose(TABLE.lower(d), LINES.lower(d), rtol=1e-13)
    np.testing.assert_allclose(LINES.upper(d) - LINES.lower(d), 0.6, rtol=1e-12)


def test_table_goes_on_as_in_its_end_segments():
    bent = TableEnvelope(d=jnp.array([0.0, 1.0, 2.0]), F_upper=jnp.array([0.0, 1.0, 3.0]), F_lower=jnp.zeros(3))
    np.testing.assert_allclose(bent.upper(jnp.array([-1.0, 0.5, 1.5, 4.0])), [-1.0, 0.5, 2.0, 7.0], rtol=1e-15)


def test_recursion_runs_alike_on_table_lines_and_functions():
    path = jnp.array([0.0, 0.3, 0.31, 1.5, 1.5, 0.9, -0.8, 0.2])
    by_lines = Recursion(upper=LINES.upper, lower=LINES.lower, beta=0.05).force(path, 9.9)
    by_table = Recursion(upper=TABLE.upper, lower=TABLE.lower, beta=0.05).force(path, 9.9)
    plain = Recursion(upper=lambda d: 1.8 * d + 10.3, lower=lambda d: 1.8 * d + 9.7, beta=0.05).force(path, 9.9)
    np.testing.assert_allclose(by_table, by_lines, rtol=1e-13)
    np.testing.assert_allclose(plain, by_lines, rtol=1e-13)


@pytest.mark.parametrize("beta", [1e-6, 0.05, 1e3])
def test_table_has_finite_gradients_at_its_rows_and_beyond(beta):
    path = jnp.array([-1.0, -0.5, 0.1, 0.1, 3.0, 0.2])

    def total(table, beta):
        return jnp.sum(Recursion(upper=table.upper, lower=table.lower, beta=beta).force(path, 9.9))

    gradients = jax.grad(total, argnums=(0, 1))(TABLE, beta)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(gradients))
