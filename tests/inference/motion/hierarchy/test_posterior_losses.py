"""Losses at every draw: those of the law at each, records by record and cases by case."""

import jax.numpy as jnp
import numpy as np
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior

from bayes_tyre.inference.motion.cycle.energy import losses
from bayes_tyre.inference.motion.cycle.stiffness import stiffnesses
from bayes_tyre.inference.motion.hierarchy.posterior_losses import OF_CASES, RING_DOWN, Middle, with_losses
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.record import RING_DOWN_MM
from bayes_tyre.rig.axle import load_rig

RIGS = {name: load_rig(name) for name in ("single", "dual")}
FACTORS = grid(repeats=1, speeds=(0.0,))


def made() -> tuple[xr.DataTree, list[Middle]]:
    k, x = np.array([1.5, 1.6, 2.5, 2.6]), np.array([0.3, 0.35, 0.5, 0.6])
    draws = {}
    for ending in ("", "_case"):
        of = {"k": k, "x": x, "beta": 0.02 * k, "m": 200 * k, "c": 0.001 * k}
        draws |= {f"{name}{ending}": fixed(values) * np.linspace(1, 1.1, 8)[:, None] for name, values in of.items()}
    middles = [Middle(RIGS[name], 10.0 + i) for i, name in enumerate(FACTORS["configuration"])]
    return posterior(draws, FACTORS), middles


def test_each_draw_is_the_law_s_own():
    tree, middles = made()
    found = with_losses(tree, FACTORS, middles, 1.5)["posterior"].to_dataset()
    at = {"chain": 1, "draw": 5, "case": 2}
    k, x, beta, m = (float(found[f"{name}_case"][at]) for name in ("k", "x", "beta", "m"))
    law = Fancher(k=k, C=0.0, x=x, beta=beta)
    cycle = middles[2].rig, law, m, middles[2].displacement_mm, jnp.asarray(1.5)
    expected = losses(*cycle)._asdict() | stiffnesses(*cycle)._asdict()
    for name, unit, field in OF_CASES:
        quantity = found[f"{name}_case"]
        np.testing.assert_allclose(quantity[at], expected[field], rtol=1e-12)
        assert quantity.attrs == {"units": unit, "amplitude_mm": RING_DOWN_MM if name == RING_DOWN else 1.5}
    # One record a case: the record's energy is its case's.
    np.testing.assert_allclose(found["energy_per_cycle"], found["energy_per_cycle_case"], rtol=1e-12)
