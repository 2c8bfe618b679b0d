"""Coordinates of sites: fewer rows than cases say the same of the terms."""

import numpy as np
import pandas as pd

from bayes_tyre.inference.model.coordinates.sites import condense
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.terms import find_terms

SPEEDS, LOADS, STEPS = (0.0, 25.0, 35.0), (10.0, 15.0, 20.0, 25.0, 30.0, 35.0), (-10.0, -5.0, 5.0, 10.0)


def test_condensed_rows_give_the_normal_equations_of_the_cases():
    random = np.random.default_rng(0)
    rows = [
        {"configuration": configuration, "direction": "loading" if step > 0 else "unloading", "speed_km_h": speed}
        | {"initial_load_kN": load, "step_kN": step}
        for configuration in ("single", "dual")
        for speed in SPEEDS
        for load in LOADS
        for step in STEPS
        for _ in range(random.integers(1, 3))
    ]
    factors = find_factors(pd.DataFrame(rows))
    design = find_terms(factors, PARAMETERS, PRIORS).design
    condensed = condense(design, factors)
    # A row for each speed, number of repeats and term, those of configuration x speed and x load among them.
    assert condensed.design.shape[1] < 0.85 * len(factors.cases)
    # Variances alike at one speed with as many repeats, and estimates of the cases that are not.
    alike = np.unique(np.stack([factors.speed.of_case, factors.repeats]), axis=1, return_inverse=True)[1].ravel()
    variance = random.uniform(0.5, 2.0, (len(PARAMETERS), alike.max() + 1))[:, alike]
    values = random.standard_normal(variance.shape)
    of_rows = variance @ condensed.shares
    np.testing.assert_allclose(
        np.einsum("put,pu,puv->ptv", condensed.design, 1.0 / of_rows, condensed.design),
        np.einsum("pct,pc,pcv->ptv", design, 1.0 / variance, design),
        atol=1e-9,
    )
    np.testing.assert_allclose(
        np.einsum("put,pu->pt", condensed.design, np.einsum("puc,pc->pu", condensed.rotation, values) / of_rows),
        np.einsum("pct,pc->pt", design, values / variance),
        atol=1e-9,
    )
