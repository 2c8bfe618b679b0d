"""Fancher's law with what a tyre may have beyond it: rubber that relaxes, friction that changes with speed, and more.

Its force is that of a middle line, two elements of friction and a branch that relaxes; with every extension at zero it
is `Fancher`. The branch is that of a standard linear solid (Zener 1948, Elasticity and Anelasticity of Metals), the
middle line that of a hardening spring, and elements of friction that settle over different lengths are Iwan's (1966).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.laws.fancher import Fancher, approach


class Extended(NamedTuple):
    """State of the law: displacement, mm; force, kN; in it the friction of both elements and the branch's force, kN."""

    d: ScalarLike
    F: ScalarLike
    short: ScalarLike
    long: ScalarLike
    branch: ScalarLike


class ExtendedFancher(StatefulLaw):
    """Fancher's law for small steps, and five numbers that are 0 where the tyre has nothing else.

    A move is exact, however long, at a steady rate. In a slow one (`step`) the branch has relaxed, and friction is that
    at rest.

    Attributes
    ----------
    k:
        Slope of the middle line, kN/mm, half-way between `ends_mm`; its chord between them.
    C:
        Force of the middle line at zero displacement, kN, as the chord has it.
    x:
        Coulomb friction of a slow move, kN, >= k beta: the force settles ``x - k beta`` off the middle line.
    beta:
        Mean of the displacements over which both elements of friction settle, mm, > 0.
    relaxing_share, relaxation_s:
        Stiffness of a spring in series with a damper, beside the others: share of k, >= 0, and relaxation time, s, > 0.
    friction_change, friction_speed_mm_per_s:
        Share by which the settled friction grows with speed, > -1, and the speed that takes 63 % of that, mm/s, > 0.
    growth_per_mm, ends_mm:
        Relative growth of the middle line's slope with displacement, 1/mm, and the displacements, mm, at which the line
        is ``k d + C`` however much it grows: those before and after a step.
    yield_spread:
        Both elements have an equal share of friction, and settle over ``(1 -+ yield_spread) beta``; >= 0 and < 1.
    """

    k: ScalarLike
    C: ScalarLike
    x: ScalarLike
    beta: ScalarLike
    relaxing_share: ScalarLike = 0.0
    relaxation_s: ScalarLike = 0.01
    friction_change: ScalarLike = 0.0
    friction_speed_mm_per_s: ScalarLike = 30.0
    growth_per_mm: ScalarLike = 0.0
    ends_mm: tuple[ScalarLike, ScalarLike] = (0.0, 0.0)
    yield_spread: ScalarLike = 0.0

    def middle_line(self, d: ScalarLike) -> Array:
        """Return the force half-way between the settled branches, kN, at displacement `d`, mm."""
        bend = 0.5 * jnp.multiply(self.k, self.growth_per_mm)
        before, after = self.ends_mm
        return jnp.multiply(self.k, d) + self.C + bend * jnp.subtract(d, before) * jnp.subtract(d, after)

    def init(self, d: ScalarLike, F: ScalarLike) -> Extended:
        """Return the state at displacement `d`, mm, under force `F`, kN, at rest: the elements bear equal shares."""
        share = 0.5 * (F - self.middle_line(d))
        return Extended(d, F, share, share, jnp.zeros_like(share))

    def step(self, state: Extended, d: ScalarLike) -> tuple[Extended, Float[Array, ""]]:
        """Return the state and the force, kN, after a slow move to displacement `d`, mm, at whose end all rests."""
        return self._moved(state, d, jnp.zeros_like(state.branch), jnp.ones_like(state.branch))

    def step_in(
        self, state: Extended, d: ScalarLike, dt_s: ScalarLike, rate: ScalarLike
    ) -> tuple[Extended, Float[Array, ""]]:
        """Return the state and the force, kN, after a move to `d`, mm, that takes `dt_s`, s, at its mean rate.

        A move that takes no time meets the branch as a spring.
        """
        del rate
        moves = jnp.asarray(dt_s) > 0
        u, dt = jnp.subtract(d, state.d), jnp.where(moves, dt_s, 1.0)
        times = jnp.where(moves, dt / self.relaxation_s, 0.0)
        kept = jnp.where(moves, -jnp.expm1(-times) / jnp.where(moves, times, 1.0), 1.0)
        branch = jnp.asarray(state.branch) * jnp.exp(-times) + jnp.multiply(self.relaxing_share, self.k) * u * kept
        speed = jnp.where(moves, jnp.abs(u) / dt, 0.0)
        change = -jnp.multiply(self.friction_change, jnp.expm1(-speed / self.friction_speed_mm_per_s))
        return self._moved(state, d, branch, 1 + change)

    def check(self) -> None:
        """Refuse parameters (concrete numbers) with which closed loops would make energy.

        Raises
        ------
        ValueError
            If x < k beta, or a field is outside of the range that its description gives.
        """
        Fancher(self.k, self.C, self.x, self.beta).check()
        share, change, spread = map(np.asarray, (self.relaxing_share, self.friction_change, self.yield_spread))
        times = np.asarray(self.relaxation_s), np.asarray(self.friction_speed_mm_per_s)
        if not (np.all(share >= 0) and all(np.all(time > 0) for time in times)):
            raise ValueError(
                "needs relaxing_share >= 0, relaxation_s > 0 and friction_speed_mm_per_s > 0; got "
                f"relaxing_share {share}, relaxation_s {times[0]}, friction_speed_mm_per_s {times[1]}"
            )
        if not np.all((change > -1) & (spread >= 0) & (spread < 1)):
            raise ValueError(
                "needs friction_change > -1 and 0 <= yield_spread < 1; got "
                f"friction_change {change}, yield_spread {spread}"
            )

    def _moved(
        self, state: Extended, d: ScalarLike, branch: Array, friction_factor: Array
    ) -> tuple[Extended, Float[Array, ""]]:
        """Return the state and the force after a move, the branch's force and the factor on friction being known."""
        u = jnp.subtract(d, state.d)
        settled = 0.5 * (self.x - jnp.multiply(self.k, self.beta)) * friction_factor
        spread = jnp.asarray(self.yield_spread)
        short = approach(u, self.beta * (1 - spread), state.short, settled)
        long = approach(u, self.beta * (1 + spread), state.long, settled)
        friction = (short - state.short) + (long - state.long)
        # Differences, so that no move changes nothing to the last digit.
        F = state.F + (self.middle_line(d) - self.middle_line(state.d)) + friction + (branch - state.branch)
        return Extended(d, F, short, long, branch), jnp.asarray(F)
