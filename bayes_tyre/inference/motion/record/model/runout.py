"""The ground under a rolling tyre: its parameters (harmonics of wheel and rollers), their priors, starting values."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2


class Rolling(NamedTuple):
    """The additional data of a rolling record's window.

    Attributes
    ----------
    body, order:
        Of each harmonic: index of the turning body (0 is the wheel) and harmonic order; shape (harmonics,).
    amplitude_mm:
        Complex amplitude of each at the wheel centre before the step, its displacement Re(a exp(i omega t)), down
        positive, shape (harmonics,).
    start_laser_mm:
        Reading of the laser at the window's start, without noise, from the harmonics before the step.
    turn_Hz:
        Turns a second of each body before the step, shape (bodies,).
    """

    body: Int[Array, " harmonics"]
    order: Int[Array, " harmonics"]
    amplitude_mm: Complex[Array, " harmonics"]
    start_laser_mm: Float[Array, ""]
    turn_Hz: Float[Array, " bodies"]

    @property
    def ground_parameters(self) -> int:
        """Number of the ground's parameters: offset and velocity at the start, turns, sines and cosines."""
        return 2 + self.turn_Hz.shape[-1] + 2 * self.order.shape[-1]


class Ground(NamedTuple):
    """Parameters of the ground under a rolling tyre, in physical units.

    Attributes
    ----------
    start_offset_mm, start_velocity_mm_per_s:
        Of the wheel centre at the window's start: displacement less that of `Rolling.start_laser_mm`, and velocity.
    frequency_Hz, sine_mm, cosine_mm:
        Of each harmonic of the ground's displacement, positive where it compresses the tyre; time starts with the
        window; shape (harmonics,).
    """

    start_offset_mm: Array
    start_velocity_mm_per_s: Array
    frequency_Hz: Float[Array, " harmonics"]
    sine_mm: Float[Array, " harmonics"]
    cosine_mm: Float[Array, " harmonics"]

    def displacement_mm(self, time_s: Float[Array, " times"]) -> Float[Array, " times"]:
        """Return the harmonics' sum at times from the window's start, s."""
        angle = 2 * jnp.pi * self.frequency_Hz[:, None] * time_s
        return self.sine_mm @ jnp.sin(angle) + self.cosine_mm @ jnp.cos(angle)


#: Prior standard deviations. Amplitudes, mm: a truck wheel is out of round by some tenths. Displacement, mm, and
#: velocity, mm/s, at the start, about their pre-step values: the road's roughness.
AMPLITUDE_MM, START_MM, START_MM_PER_S = 0.3, 0.03, 3.0


def ground_priors(
    velocity_mm_per_s: float, log_turn: Float[np.ndarray, " bodies"], log_turn_sd: Float[np.ndarray, " bodies"], n: int
) -> Float[np.ndarray, "2 parameters"]:
    """Return prior means and standard deviations of the ground's parameters, shape (2, parameters).

    Parameters
    ----------
    velocity_mm_per_s:
        Of the wheel centre at the start, from the pre-step harmonics.
    log_turn, log_turn_sd:
        Logarithm of each body's turns a second, and its standard deviation, from the pre-step harmonics.
    n:
        Number of harmonics.
    """
    mean = np.concatenate([[0.0, velocity_mm_per_s], log_turn, np.zeros(2 * n)])
    sd = np.concatenate([[START_MM, START_MM_PER_S], log_turn_sd, np.full(2 * n, AMPLITUDE_MM)])
    return np.stack([mean, sd])


def ground_start(
    rolling: Rolling, log_turn: Float[np.ndarray, " bodies"], k: float, m_kg: float, c_kN_s_per_mm: float
) -> Float[np.ndarray, " amplitudes"]:
    """Return starting values of sines and cosines, mm: those that move a mass on a spring by the observed amplitudes.

    Parameters
    ----------
    rolling:
        Observed harmonics.
    log_turn:
        Logarithm of each body's turns a second.
    k, m_kg, c_kN_s_per_mm:
        Stiffness, mass and damping at the wheel centre.
    """
    omega = 2 * np.pi * np.exp(log_turn)[np.asarray(rolling.body)] * np.asarray(rolling.order)
    mass = m_kg * KN_PER_KG_MM_PER_S2
    ground = -np.asarray(rolling.amplitude_mm) * (k - mass * omega**2 + 1j * c_kN_s_per_mm * omega) / k
    return np.concatenate([-ground.imag, ground.real])


def ground_in_units(value: Float[Array, " ground"], rolling: Rolling) -> Ground:
    """Return the ground's parameters in physical units from their values on the scale of their priors."""
    n = rolling.order.shape[-1]
    turn_Hz = jnp.exp(value[2 : -2 * n])
    frequency = turn_Hz[rolling.body] * rolling.order
    return Ground(value[0], value[1], frequency, value[-2 * n : -n], value[-n:])
