"""An axle on a tyre for tests of its motion, and what diffrax and scipy make of it, written out in plain numbers."""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.motion import Body, Drive, Motion, Start, move, node_times, rest_displacement, substeps_for
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

RIG = load_rig("single")
K, C, X, BETA, M, DAMPING = 1.7, 0.3, 0.4, 0.06, 285.0, 0.0013
LAW = Fancher(k=K, C=C, x=X, beta=BETA)
STEP_START_S, RISE_S = 0.05, 0.036
HEIGHT, HALF, FACTOR = geometry.centre_height_mm(RIG), 253.0, geometry.curvature_factor(RIG)


class Spring(StatefulLaw):
    """A linear spring: no memory, so that others can integrate it straight through."""

    k: ScalarLike

    def init(self, d, F):
        return d

    def step(self, state, d):
        return d, self.k * d


def applied(time_s: Any, xp: Any = np) -> Any:
    """30 kN down to 20 kN on the cylinder, and what that is at the wheel centre."""
    s = xp.clip((time_s - STEP_START_S) / RISE_S, 0, 1)
    return (30.0 - 5.0 * (1 - xp.cos(np.pi * s))) * (875 / 1300) + 2.518


def runout(time_s: Any, amplitude: float, xp: Any = np) -> Any:
    return amplitude * (xp.sin(2 * np.pi * 2.9 * time_s) + 0.3 * xp.sin(2 * np.pi * 11.6 * time_s + 1.0))


def driven(rate_Hz: float, duration_s: float, amplitude: float = 0.0, max_step_s: float = 2e-4) -> tuple[Drive, int]:
    substeps = substeps_for(1 / rate_Hz, max_step_s)
    nodes = node_times(np.arange(round(duration_s * rate_Hz) + 1) / rate_Hz, substeps)
    return Drive(nodes, applied(nodes), runout(nodes, amplitude)), substeps


def at_rest(offset: float = C) -> Array:
    return rest_displacement(RIG, applied(np.zeros(1))[0], k=K, offset_kN=offset)


moved = jax.jit(lambda body, drive, start: move(RIG, body, drive, start))


def motion(
    rate_Hz: float, duration_s: float, amplitude: float = 0.0, max_step_s: float = 2e-4, law: StatefulLaw = LAW
) -> tuple[Body, Drive, Motion, Motion]:
    """Return what was moved, by what, the motion at the nodes and at the samples; the runout starts from rest."""
    body = Body(law, M, DAMPING)
    drive, substeps = driven(rate_Hz, duration_s, amplitude, max_step_s)
    whole = moved(body, drive, Start(at_rest() - jnp.asarray(drive.runout_mm)[0]))
    return body, drive, whole, whole.at_samples(substeps)


class Energies(NamedTuple):
    """Energies from the first node to the last, at the wheel centre, J = kN mm; applied = the sum of the others."""

    applied: Float[Array, ""]
    kinetic: Float[Array, ""]
    tyre: Float[Array, ""]
    damping: Float[Array, ""]


def energies(body: Body, drive: Drive, motion: Motion) -> Energies:
    """Return the energy account of a motion, by Simpson's rule over the nodes: what it does not close is its error.

    ``applied`` is the work of the applied force, ``kinetic`` the gain of kinetic energy, ``tyre`` the work that the
    axle does on the tyre (kept and lost; runout does work of its own on the tyre), ``damping`` the viscous loss.
    """
    dt = jnp.diff(jnp.asarray(drive.time_s, float)[::2])
    F, v = jnp.asarray(drive.applied_kN, float), motion.velocity_mm_per_s

    def over_time(power: Array) -> Array:
        return jnp.sum(dt / 6 * (power[:-2:2] + 4 * power[1::2] + power[2::2]))

    kinetic = jnp.asarray(KN_PER_KG_MM_PER_S2 * body.m_kg / 2 * (v[-1] ** 2 - v[0] ** 2))
    damping = over_time(jnp.asarray(body.c_kN_s_per_mm * v**2))
    return Energies(over_time(F * v), kinetic, over_time(motion.tyre_force_kN * v), damping)


# What others integrate is written out here anew, in plain numbers.
def to_flat(e: Any, xp: Any = np) -> tuple[Any, Any]:
    sine = (HEIGHT - e) / xp.hypot(HEIGHT - e, HALF)
    return e * sine, FACTOR * sine


def flat_rate(e: float) -> float:
    """d(e sin theta)/de."""
    u = HEIGHT - e
    return u / np.hypot(u, HALF) - e * HALF**2 / np.hypot(u, HALF) ** 3


def fancher_by_scipy(times: np.ndarray, friction: float) -> np.ndarray:
    """Return displacements of the axle on Fancher's law, integrated from reversal to reversal, s fixed in between."""
    start = float(at_rest(C + friction))
    y, t, s, d = np.array([start, 0.0, K * to_flat(start)[0] + C + friction]), STEP_START_S, -1.0, []

    def rates(t, y):
        d_flat, factor = to_flat(y[0])
        rate = s * (K * d_flat + C + s * X - y[2]) / BETA
        return [y[1], (applied(t) - factor * y[2] - DAMPING * y[1]) / (M * 1e-6), rate * flat_rate(y[0]) * y[1]]

    def turns(t, y):
        return y[1] + 1e-30  # the start, at rest, is no turn

    turns.terminal = True
    while True:
        turns.direction = -s
        inside = times[(times > t) & (times <= times[-1])]
        span = (t, times[-1])
        piece = solve_ivp(rates, span, y, "DOP853", inside, events=turns, rtol=1e-11, atol=1e-11, max_step=1e-3)
        d.append(piece.y[0])
        if piece.status == 0:
            return np.concatenate([np.full(int(np.sum(times <= STEP_START_S)), start), *d])
        t, y, s = piece.t_events[0][0], piece.y_events[0][0] * [1, 0, 1], -s


def spring_by_diffrax(times: np.ndarray, start: float, amplitude: float) -> np.ndarray:
    """Return displacement and velocity of the axle on a linear spring over a runout."""

    def rates(t, y, _):
        d_flat, factor = to_flat(y[0] + runout(t, amplitude, jnp), jnp)
        return jnp.stack([y[1], (applied(t, jnp) - factor * K * d_flat - DAMPING * y[1]) / (M * 1e-6)])

    solved = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        diffrax.Dopri8(),
        times[0],
        times[-1],
        1e-5,
        jnp.asarray([start, 0.0]),
        saveat=diffrax.SaveAt(ts=jnp.asarray(times)),
        # The load's second derivative jumps at both ends of its step: no step may pass over them unseen.
        stepsize_controller=diffrax.PIDController(rtol=1e-12, atol=1e-12, dtmax=1e-3),
        max_steps=100_000,
    )
    return np.asarray(solved.ys).T
