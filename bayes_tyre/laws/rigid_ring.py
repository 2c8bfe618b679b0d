"""A rigid ring: the belt's mass between the sidewall and what lies beneath it, the vertical part of the SWIFT model.

``m_b y'' = k_s (d - y) + c_s (d' - y') - k_r y`` and ``F = k_s (d - y) + c_s (d' - y') + C``, y the belt's
displacement, k_s and c_s spring and damper of the sidewall, k_r the residual stiffness between belt and road. Up to
some 100 Hz a tyre's belt moves like a rigid ring (Zegelaar 1998, The dynamic response of tyres to brake torque
variations and road unevennesses; Pacejka, Tyre and Vehicle Dynamics). Slow moves meet both springs in series,
``1 / k = 1 / k_s + 1 / k_r``: k is what it is in other laws. Of the belt's mass a part moves along with the axle; a fit
counts it in m, which so is all that moves, as with other laws.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike, StatefulLaw


class Ring(NamedTuple):
    """State of the ring: displacement, mm, its rate, mm/s, force, kN; the belt's displacement and rate."""

    d: ScalarLike
    rate: ScalarLike
    F: ScalarLike
    belt: ScalarLike
    belt_rate: ScalarLike


class RigidRing(StatefulLaw):
    """A belt that swings between sidewall and road; linear, so a move along a cubic over time is exact, however long.

    Three parameters define the belt, and a step record sampled at 10 kHz identifies all of them: its frequency by the
    ripple on the axle's acceleration, the ratio by the ripple's size and by how much more of the belt moves along as
    the axle swings faster, the damping ratio by the ripple's decay. Mass and stiffness of the belt follow; as
    parameters they would be strongly correlated.

    Attributes
    ----------
    k:
        Static stiffness, kN/mm, > 0.
    C:
        Force at zero displacement, kN.
    belt_frequency:
        Of the belt between both springs with the rim held, undamped, Hz, > 0.
    belt_damping:
        Damping ratio of that swing, by the sidewall's damper, >= 0 and < 1: a belt that swings.
    sidewall_ratio:
        Stiffness of the sidewall over the residual stiffness, > 0. Large: nearly all of the belt moves with the rim.
    """

    k: ScalarLike
    C: ScalarLike
    belt_frequency: ScalarLike
    belt_damping: ScalarLike
    sidewall_ratio: ScalarLike

    @property
    def belt_kg(self) -> Array:
        """The belt's mass, kg."""
        # 1 kN/mm is 1e6 kg/s^2.
        springs = 1e6 * jnp.multiply(self.k, 1 + jnp.asarray(self.sidewall_ratio)) ** 2 / self.k / self.sidewall_ratio
        return springs / self._omega**2

    @property
    def carried_kg(self) -> Array:
        """What of the belt's mass moves along with a slow motion of the axle, kg: what ``followed^2`` leaves of it."""
        return self.belt_kg * self._followed**2

    @property
    def first_mode(self) -> Array:
        """Natural frequency of the belt on the sidewall alone, Hz: of mode 1 of a `FlexibleRing`, which no road holds.

        The sidewall's stiffness over the belt's mass is pi R (k_w + k_v) / (2 pi R rho A) there.
        """
        return jnp.multiply(self.belt_frequency, jnp.sqrt(self._followed))

    def dynamic_stiffness(self, omega: ScalarLike) -> Array:
        """Return force over displacement at an angular frequency, 1/s: complex, kN/mm; its imaginary part loses energy.

        A cycle of amplitude a loses pi a^2 times it.
        """
        r = jnp.asarray(omega) / self._omega
        follows = self._followed + 2j * self.belt_damping * r
        sidewall = self._sidewall + 1j * self._damper * jnp.asarray(omega)
        return sidewall * (1 - follows / (1 - r**2 + 2j * self.belt_damping * r))

    def init(self, d: ScalarLike, F: ScalarLike) -> Ring:
        """Return the state at displacement `d`, mm, under force `F`, kN, at rest; a start off the line stays off it."""
        zero = jnp.zeros_like(d)
        return Ring(d, zero, F, self._followed * d, zero)

    def step(self, state: Ring, d: ScalarLike) -> tuple[Ring, Float[Array, ""]]:
        """Return the state and the force, kN, after a slow move to displacement `d`, mm, at whose end all rests."""
        zero = jnp.zeros_like(state.belt)
        return self._at(state, d, zero, self._followed * d, zero)

    def step_in(self, state: Ring, d: ScalarLike, dt_s: ScalarLike, rate: ScalarLike) -> tuple[Ring, Float[Array, ""]]:
        """Return the state and the force, kN, after a move to `d`, mm, in `dt_s`, s, that ends at `rate`, mm/s.

        The way between is the cubic with displacement and rate at both ends. A move that takes no time meets the
        sidewall.
        """
        moved, dt = jnp.asarray(dt_s) > 0, jnp.where(jnp.asarray(dt_s) > 0, dt_s, 1.0)
        u = jnp.subtract(d, state.d)
        square = (3 * u / dt - 2 * jnp.asarray(state.rate) - rate) / dt
        cube = (jnp.add(state.rate, rate) - 2 * u / dt) / dt**2
        off, off_1, off_2 = self._off_place(state.rate, square, cube)
        # About that way the belt swings freely, from where it is beside it.
        z = state.belt - self._followed * state.d - off
        z_rate = state.belt_rate - self._followed * state.rate - off_1
        cosine, sine = _swing(self._omega * dt, jnp.asarray(self.belt_damping))
        lag = self.belt_damping * z + z_rate / self._omega
        back = self._omega * z + self.belt_damping * z_rate
        belt = self._followed * d + off + dt * (off_1 + dt * off_2) + z * cosine + lag * sine
        belt_rate = self._followed * rate + off_1 + 2 * dt * off_2 + z_rate * cosine - back * sine
        return self._at(
            state, d, rate, jnp.where(moved, belt, state.belt), jnp.where(moved, belt_rate, state.belt_rate)
        )

    def check(self) -> None:
        """Refuse k, belt_frequency, sidewall_ratio <= 0 and a belt_damping not in [0, 1) (concrete numbers).

        Raises
        ------
        ValueError
            If any of the parameters, single or stacked, is so.
        """
        fields = self.k, self.belt_frequency, self.belt_damping, self.sidewall_ratio
        k, frequency, damping, ratio = map(np.asarray, fields)
        if not np.all((k > 0) & (frequency > 0) & (damping >= 0) & (damping < 1) & (ratio > 0)):
            raise ValueError(
                "needs k, belt_frequency and sidewall_ratio > 0 and 0 <= belt_damping < 1; got "
                f"k {k}, belt_frequency {frequency}, belt_damping {damping}, sidewall_ratio {ratio}"
            )

    @property
    def _omega(self) -> Array:
        return 2 * np.pi * jnp.asarray(self.belt_frequency)

    @property
    def _followed(self) -> Array:
        """Share of a slow displacement that the belt goes: what the sidewall leaves of it."""
        return jnp.divide(self.sidewall_ratio, 1 + jnp.asarray(self.sidewall_ratio))

    @property
    def _sidewall(self) -> Array:
        return jnp.multiply(self.k, 1 + jnp.asarray(self.sidewall_ratio))

    @property
    def _damper(self) -> Array:
        """The sidewall's damper, kN s/mm: 2 zeta over omega times both springs beside one another."""
        return 2 * jnp.asarray(self.belt_damping) / self._omega * self._sidewall / self._followed

    def _off_place(self, rate: ScalarLike, square: Array, cube: Array) -> tuple[Array, Array, Array]:
        """Return how far off its place at rest the belt goes without swinging: a parabola over time, its coefficients.

        The displacement goes as ``rate t + square t^2 + cube t^3``; of what the belt would be at rest it is off by e,
        ``e'' + 2 zeta omega e' + omega^2 e = 2 zeta omega (1 - followed) d' - followed d''``.
        """
        omega, damping = self._omega, 2 * jnp.asarray(self.belt_damping) * self._omega
        drag = damping * (1 - self._followed)
        second = 3 * drag * cube / omega**2
        first = (2 * drag * square - 6 * self._followed * cube - 2 * damping * second) / omega**2
        return (drag * rate - 2 * self._followed * square - damping * first - 2 * second) / omega**2, first, second

    def _at(
        self, state: Ring, d: ScalarLike, rate: ScalarLike, belt: Array, belt_rate: Array
    ) -> tuple[Ring, Float[Array, ""]]:
        """Return the state with all at these places, and its force."""
        spring = jnp.subtract(d, state.d) - (belt - state.belt)
        damper = jnp.subtract(rate, state.rate) - (belt_rate - state.belt_rate)
        F = self._sidewall * spring + self._damper * damper + state.F
        return Ring(d, rate, F, belt, belt_rate), F


def _swing(angle: Array, damping: Array) -> tuple[Array, Array]:
    """Return exp(-zeta a) cos(q a) and exp(-zeta a) sin(q a) / q, q = sqrt(1 - zeta^2), of the damping ratio zeta < 1.

    A swing ``y'' + 2 zeta y' + y = 0`` from y and y' is ``y cosine + (zeta y + y') sine`` after the angle a.
    """
    q, fade = jnp.sqrt(1 - damping**2), jnp.exp(-damping * angle)
    return fade * jnp.cos(q * angle), fade * jnp.sin(q * angle) / q
