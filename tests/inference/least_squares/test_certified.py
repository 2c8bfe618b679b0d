"""NIST's certified sets of the form b1 (1 - exp(-b2 x)): Equation 2 with k = d_i = F_i = 0, C = b1, beta = 1 / b2."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.certified_sets import SETS, Certified
from helpers.one_record import NAN, Fit, determined, rows

from bayes_tyre.inference.least_squares.estimate import estimate_batch
from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, PARAMETERS, C, K
from bayes_tyre.inference.least_squares.scaled_problem import Problem

#: Run beside the data's own start, as a start that a user gives is.
FAR_STARTS = {
    "straight": (1.0, 1e-9),
    "step": (1.0, 1.0),
    "sharper step": (-1e3, 1e3),
    "huge": (1e6, 1e-6),
    "nothing": (0.0, 1e-2),
    "absurd": (1e200, 1e-200),
}
NONE = "no start"


def nan_start(**values: float) -> list[float]:
    return [values.get(name, NAN) for name in PARAMETERS]


@pytest.fixture(scope="module", params=[*SETS])
def certified(request) -> tuple[Certified, dict[str, Fit]]:
    """The fits of a set, one a start, all of one batch: from NIST's alone, from far ones beside the data's own."""
    its = SETS[request.param]
    starts = {name: [nan_start(C=b1, beta=1 / b2)] * 2 for name, (b1, b2) in its.starts.items()}
    starts |= {name: [nan_start(C=b1, beta=1 / b2), nan_start()] for name, (b1, b2) in FAR_STARTS.items()}
    starts |= {NONE: [nan_start()] * 2}
    shape = (len(starts), len(its.x))
    problems = Problem(
        d=jnp.broadcast_to(jnp.array(its.x), shape),
        F=jnp.broadcast_to(jnp.array(its.y), shape),
        used=jnp.ones(shape, bool),
        fixed=jnp.broadcast_to(jnp.array([0.0, NAN, NAN, 0.0, 0.0]), (len(starts), 5)),
        start=jnp.array(list(starts.values())),
    )
    return its, rows(estimate_batch(problems, (C, BETA)), [*starts])


@pytest.mark.parametrize("start", ["NIST 1", "NIST 2", *FAR_STARTS, NONE])
def test_certified_values_come_back_to_eight_digits(certified, start):
    its, fits = certified
    found = fits[start]
    b2 = 1 / found.value[BETA]
    assert found.converged
    assert found.value[C] == pytest.approx(its.b1, rel=1e-8)
    assert b2 == pytest.approx(its.b2, rel=1e-8)
    assert found.standard_error[C] == pytest.approx(its.b1_sd, rel=1e-8)
    assert found.standard_error[BETA] * b2**2 == pytest.approx(its.b2_sd, rel=1e-8)
    assert np.sqrt(found.rss / (len(its.x) - 2)) == pytest.approx(its.residual_sd, rel=1e-8)
    assert determined(found)


def test_fixed_parameters_keep_their_value_and_have_no_standard_error(certified):
    found = certified[1]["NIST 1"]
    assert found.value[[K, D_I, F_I]].tolist() == [0.0, 0.0, 0.0]
    assert np.isnan(found.standard_error[[K, D_I, F_I]]).all()
