"""Harmonics of a rolling axle's motion before the step, from laser and accelerometer together."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int

Values = Float[np.ndarray, "..."]
#: Gauss-Newton steps for the turns a second, whose nominal values are accurate to a few parts in ten thousand.
_STEPS = 4
#: Factor on a turn frequency's standard deviation under white noise, and its least relative value: the road's roughness
#: is not white, and no wheel turns at an exactly constant rate.
_TURN_SD_TIMES, _TURN_SD_LEAST = 3.0, 3e-5


class PreStepHarmonics(NamedTuple):
    """Harmonics of the motion at the measurement point before the step, down positive, time from the window's start.

    Attributes
    ----------
    body, order:
        Of each harmonic, shape (harmonics,).
    turn_Hz, turn_sd:
        Turns a second of each body, and their relative standard deviation, shape (bodies,).
    amplitude_mm:
        Complex amplitude a of each harmonic's displacement Re(a exp(i omega t)), shape (harmonics,).
    laser_mm, acceleration_m_per_s2:
        Means of both channels without harmonics, each with its standard error.
    """

    body: Int[np.ndarray, " harmonics"]
    order: Int[np.ndarray, " harmonics"]
    turn_Hz: Float[np.ndarray, " bodies"]
    turn_sd: Float[np.ndarray, " bodies"]
    amplitude_mm: Complex[np.ndarray, " harmonics"]
    laser_mm: tuple[float, float]
    acceleration_m_per_s2: tuple[float, float]

    @property
    def omega(self) -> Float[np.ndarray, " harmonics"]:
        """Return the harmonics' angular frequencies, 1/s."""
        return 2 * np.pi * self.turn_Hz[self.body] * self.order


def fit_harmonics(
    time_s: Values, acceleration_m_per_s2: Values, laser_mm: Values, bodies: Sequence[tuple[float, int]]
) -> PreStepHarmonics:
    """Return the pre-step harmonics and turns a second by least squares of both channels.

    Parameters
    ----------
    time_s:
        From the window's start: negative before it.
    acceleration_m_per_s2, laser_mm:
        Means over a few ms of the channels.
    bodies:
        Turns a second and number of harmonics of each turning body.
    """
    body = np.repeat(np.arange(len(bodies)), [harmonics for _, harmonics in bodies])
    order = np.concatenate([np.arange(1, harmonics + 1) for _, harmonics in bodies])
    turn = np.array([turn_Hz for turn_Hz, _ in bodies])
    values = np.stack([acceleration_m_per_s2, laser_mm])
    sd = np.std(np.diff(values, axis=1), axis=1) / np.sqrt(2)
    for _ in range(_STEPS):
        omega = 2 * np.pi * turn[body] * order
        linear = _columns(time_s, omega)
        weights = _solve(linear, values, sd)[0]
        derivative = _turn_derivative(time_s, omega, weights, body, len(turn))
        weights, covariance, misfit = _solve(np.concatenate([linear, derivative]), values, sd)
        turn = turn * np.exp(weights[-len(turn) :])
    n = len(order)
    error = np.sqrt(np.diag(covariance))
    return PreStepHarmonics(
        body,
        order,
        turn,
        np.maximum(_TURN_SD_TIMES * error[-len(turn) :] * misfit, _TURN_SD_LEAST),
        weights[:n] - 1j * weights[n : 2 * n],
        (float(weights[2 * n + 1]), float(error[2 * n + 1] * misfit * _TURN_SD_TIMES)),
        (float(weights[2 * n]), float(error[2 * n] * misfit * _TURN_SD_TIMES)),
    )


def _columns(time_s: Values, omega: Values) -> Float[np.ndarray, "columns 2 values"]:
    """Return cosines, sines and levels as accelerometer (up, m/s^2) and laser (down, mm) read them."""
    angle = omega[:, None] * time_s
    turns = np.concatenate([np.cos(angle), np.sin(angle)])
    squared = np.tile(omega, 2)[:, None] ** 2 * 1e-3
    levels = np.zeros((2, 2, len(time_s)))
    levels[0, 0] = levels[1, 1] = 1.0
    return np.concatenate([np.stack([squared * turns, turns], axis=1), levels])


def _turn_derivative(time_s: Values, omega: Values, weights: Values, body: np.ndarray, bodies: int) -> np.ndarray:
    """Return the derivative of the readings by the logarithm of each body's turns a second."""
    n, angle = len(omega), omega[:, None] * time_s
    a, b = weights[:n, None], weights[n : 2 * n, None]
    turned = angle * (b * np.cos(angle) - a * np.sin(angle))
    squared = omega[:, None] ** 2 * 1e-3
    rise = squared * (turned + 2 * (a * np.cos(angle) + b * np.sin(angle)))
    return np.stack([np.stack([rise[body == i].sum(0), turned[body == i].sum(0)]) for i in range(bodies)])


def _solve(columns: np.ndarray, values: np.ndarray, sd: Values) -> tuple[Values, np.ndarray, float]:
    """Return weights, their covariance in white noise of `sd`, and the ratio of the misfit to it, at least 1."""
    design = (columns / sd[:, None]).reshape(len(columns), -1)
    target = (values / sd[:, None]).ravel()
    covariance = np.linalg.pinv(design @ design.T, hermitian=True)
    weights = covariance @ (design @ target)
    misfit = np.sqrt(np.mean((target - weights @ design) ** 2))
    return weights, covariance, max(float(misfit), 1.0)
