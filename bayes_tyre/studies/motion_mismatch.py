"""Mismatches between the motion model and the truth, and how each is simulated."""

from collections.abc import Callable
from dataclasses import replace

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import Point, ScalarLike, StatefulLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.simulate.truth import Truth

#: Frequency of the turns of wheel and rollers over that from their radii; mass over the rig file's; slope of the road's
#: spectrum, half that of the fit; growth of the stiffness, 1/mm.
TURNS, MASS, ROAD_SLOPE, CURVATURE_PER_MM = 1.005, 1.05, 0.5, 0.02

#: Input of the simulator: a truth and a law; None: the truth's own law.
Simulated = tuple[Truth, StatefulLaw | None]


class CurvedFancher(StatefulLaw):
    """Fancher's law between envelopes that curve: ``k d + C + q (d - d_m)^2 +- x``, the limit for small steps.

    Attributes
    ----------
    k, C, x, beta:
        As in `Fancher`; k is the slope at d_m.
    q, d_m:
        Half the growth of the slope, kN/mm^2, and where the curve touches the line, mm.
    """

    k: ScalarLike
    C: ScalarLike
    x: ScalarLike
    beta: ScalarLike
    q: ScalarLike
    d_m: ScalarLike

    def step(self, state: Point, d: ScalarLike) -> tuple[Point, Float[Array, ""]]:
        """Return the state and the force, kN, after a monotone move to displacement `d`, mm.

        With an envelope L the force settles on L - s beta L' + beta^2 L'', s the direction: the exact solution of
        ``dF/dd = s (L - F) / beta`` for a parabola.
        """
        d_i, F_i = state
        s = jnp.sign(jnp.subtract(d, d_i))

        def settled(at: ScalarLike) -> Array:
            off = jnp.subtract(at, self.d_m)
            slope = self.k + 2 * self.q * off
            line = jnp.multiply(self.k, at) + self.C + self.q * off**2
            return line + s * (self.x - self.beta * slope) + 2 * self.q * jnp.square(self.beta)

        F = settled(d) + jnp.exp(-jnp.abs(jnp.subtract(d, d_i)) / self.beta) * (F_i - settled(d_i))
        F = jnp.where(s == 0, F_i, F)
        return (d, F), F


def _as_fitted(truth: Truth, _: Rig) -> Simulated:
    return truth, None


def _turns(truth: Truth, _: Rig) -> Simulated:
    runout = truth.runout
    faster = {name: getattr(runout, name) * TURNS for name in ("wheel_turn_Hz", "roller_turn_Hz")}
    return replace(truth, runout=runout._replace(**faster)), None


def _road(truth: Truth, _: Rig) -> Simulated:
    return replace(truth, runout=truth.runout._replace(road_slope=ROAD_SLOPE)), None


def _curved(truth: Truth, rig: Rig) -> Simulated:
    k, middle = truth.k_kN_per_mm, (truth.load_before_kN + truth.load_after_kN) / 2
    d_m = float(geometry.flat_ground_displacement(rig, geometry.wheel_centre_start(rig, middle, k)))
    law = CurvedFancher(k, truth.C_kN, truth.x_kN, truth.beta_mm, k * CURVATURE_PER_MM / 2, d_m)
    return truth, law


def _mass(truth: Truth, rig: Rig) -> Simulated:
    return replace(truth, m_kg=MASS * rig.axle.effective_mass_kg), None


def _lag(truth: Truth, _: Rig) -> Simulated:
    return replace(truth, load_shape="first-order lag"), None


def _stages(truth: Truth, _: Rig) -> Simulated:
    return replace(truth, load_shape="two stages"), None


#: Changes of a truth, by name.
MISMATCHES: dict[str, Callable[[Truth, Rig], Simulated]] = {
    "none": _as_fitted,
    "turns 0.5 % off": _turns,
    "road's slope 0.5": _road,
    "stiffness grows 2 %/mm": _curved,
    "mass 5 % off": _mass,
    "first-order lag": _lag,
    "load in two stages": _stages,
}
#: Mismatches of rolling records alone.
ROLLING_ONLY = ("turns 0.5 % off", "road's slope 0.5")
