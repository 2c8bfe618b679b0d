"""The ground under a rolling tyre: harmonics of wheel and rollers among a motion's unknowns, and how it starts."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2


class Rolling(NamedTuple):
    """What a window of a rolling record needs beside its readings.

    Attributes
    ----------
    body, order:
        Of each harmonic: which body turns (0 the wheel), and how often its turn; shape (harmonics,).
    seen_mm:
        Complex amplitude of each at the wheel centre before the step, its displacement Re(a exp(i omega t)), down
        positive, shape (harmonics,).
    start_laser_mm:
        Reading of the laser at the window's start, without noise, as the quiet stretch before the step says.
    """

    body: Int[Array, " harmonics"]
    order: Int[Array, " harmonics"]
    seen_mm: Complex[Array, " harmonics"]
    start_laser_mm: Float[Array, ""]


class Ground(NamedTuple):
    """Unknowns of a rolling record, in units.

    Attributes
    ----------
    start_off_mm, start_velocity_mm_per_s:
        Of the wheel centre at the window's start: displacement less what `Rolling.start_laser_mm` says, and velocity.
    frequency_Hz, sine_mm, cosine_mm:
        Of each harmonic of the ground's displacement, positive where it compresses the tyre; time starts with the
        window; shape (harmonics,).
    """

    start_off_mm: Array
    start_velocity_mm_per_s: Array
    frequency_Hz: Float[Array, " harmonics"]
    sine_mm: Float[Array, " harmonics"]
    cosine_mm: Float[Array, " harmonics"]

    def displacement_mm(self, time_s: Float[Array, " times"]) -> Float[Array, " times"]:
        """Return the harmonics' sum at times from the window's start, s."""
        angle = 2 * jnp.pi * self.frequency_Hz[:, None] * time_s
        return self.sine_mm @ jnp.sin(angle) + self.cosine_mm @ jnp.cos(angle)


#: Amplitudes before the record, mm: a truck wheel out of round by some tenths. Of a start's displacement, mm, less
#: what the quiet stretch says, and of its velocity, mm/s: what the road's roughness adds.
AMPLITUDE_MM, START_MM, START_MM_PER_S = 0.3, 0.03, 3.0


def ground_names(bodies: Sequence[tuple[float, int]]) -> tuple[str, ...]:
    """Return the names of a rolling record's further unknowns, in their order.

    Parameters
    ----------
    bodies:
        Turns a second and number of harmonics of each turning body.
    """
    turns = [f"log_turn_{i}" for i in range(len(bodies))]
    of = [f"{i}_{order}" for i, (_, harmonics) in enumerate(bodies) for order in range(1, harmonics + 1)]
    return ("start_off_mm", "start_velocity_mm_per_s", *turns, *(f"sine_{h}" for h in of), *(f"cosine_{h}" for h in of))


def ground_priors(
    velocity_mm_per_s: float, log_turn: Float[np.ndarray, " bodies"], log_turn_sd: Float[np.ndarray, " bodies"], n: int
) -> Float[np.ndarray, "2 unknowns"]:
    """Return locations and scales of a rolling record's further unknowns, shape (2, unknowns).

    Parameters
    ----------
    velocity_mm_per_s:
        Of the wheel centre at the start, as the quiet stretch says.
    log_turn, log_turn_sd:
        Logarithm of each body's turns a second, and its standard deviation, from the quiet stretch.
    n:
        Number of harmonics.
    """
    location = np.concatenate([[0.0, velocity_mm_per_s], log_turn, np.zeros(2 * n)])
    scale = np.concatenate([[START_MM, START_MM_PER_S], log_turn_sd, np.full(2 * n, AMPLITUDE_MM)])
    return np.stack([location, scale])


def ground_start(
    rolling: Rolling, log_turn: Float[np.ndarray, " bodies"], k: float, m_kg: float, c_kN_s_per_mm: float
) -> Float[np.ndarray, " amplitudes"]:
    """Return sines and cosines, mm, that move a mass on a spring as was seen: where a fit may start.

    Parameters
    ----------
    rolling:
        What was seen.
    log_turn:
        Logarithm of each body's turns a second.
    k, m_kg, c_kN_s_per_mm:
        Stiffness, mass and damping at the wheel centre.
    """
    omega = 2 * np.pi * np.exp(log_turn)[np.asarray(rolling.body)] * np.asarray(rolling.order)
    mass = m_kg * KN_PER_KG_MM_PER_S2
    ground = -np.asarray(rolling.seen_mm) * (k - mass * omega**2 + 1j * c_kN_s_per_mm * omega) / k
    return np.concatenate([-ground.imag, ground.real])


def ground_in_units(value: Float[Array, " further"], rolling: Rolling) -> Ground:
    """Return the further unknowns in units from their values on the scale of their priors."""
    n = rolling.order.shape[-1]
    turn_Hz = jnp.exp(value[2 : len(value) - 2 * n])
    frequency = turn_Hz[rolling.body] * rolling.order
    return Ground(value[0], value[1], frequency, value[-2 * n : -n], value[-n:])
