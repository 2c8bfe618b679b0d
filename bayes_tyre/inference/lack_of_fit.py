"""Whether the points of a record follow the curve fitted to them, told apart from noise.

Residuals are projected on slow waves along the record, what the fit's own parameters can take up left out. Where a
curve is wrong they follow such waves; noise has as much of them as of the quicker ones. Size and significance do not
depend on how densely a curve is sampled: residuals that follow each other count as fewer.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.special import fdtrc

from bayes_tyre.inference.record_data import EQUATION_2, LAWS

#: Waves of up to three periods along a record; parameters of a law that take up part of them.
WAVES, CURVE_PARAMETERS = 6, 4
#: Fewest points in which waves and noise are told apart: six are left to say how large the noise is.
WAVE_POINTS = WAVES + CURVE_PARAMETERS + 6
#: Part of the change of force above which lack of fit is one: about the noise of a good rig, so that no curve
#: within it is blamed for what the measurement leaves open.
MISFIT_MOST = 0.01
#: Probability that noise alone has slow waves so large, below which it is not noise: of a record by itself.
CHANCE = 0.025
#: Root mean square of the residuals, as a part of the change of force, above which too few points cannot tell noise
#: from another law.
GROSS = 0.05
#: Largest autocorrelation of what the waves leave: nearer to 1, nothing would be left of the number of points.
_LARGEST_RHO = 0.99


class Misfit(NamedTuple):
    """How far records are off their curves; shape (records,).

    Attributes
    ----------
    rms:
        Root mean square of the residuals, as a part of the record's change of force.
    share:
        The same of what is not noise.
    p_value:
        Probability that noise alone has slow waves so large; NaN for records of fewer than `WAVE_POINTS` points.
    """

    rms: Float[np.ndarray, " records"]
    share: Float[np.ndarray, " records"]
    p_value: Float[np.ndarray, " records"]

    def wrong_curve(self, chance: float = CHANCE) -> Bool[np.ndarray, " records"]:
        """Return which records follow another curve: by more than noise explains, and enough to matter."""
        return (self.share > MISFIT_MOST) & (self.p_value < chance)

    @property
    def cannot_tell(self) -> Bool[np.ndarray, " records"]:
        """Which records are far off their curve, with too few points to tell noise from another curve."""
        return np.isnan(self.p_value) & (self.rms > GROSS)

    @property
    def unjudged(self) -> Bool[np.ndarray, " records"]:
        """Which records are off their curve by more than `wrong_curve` lets pass, with too few points to say why."""
        return np.isnan(self.p_value) & (self.rms > MISFIT_MOST)


def misfit(
    residual_kN: Float[np.ndarray, "records points"],
    tangents: Float[Array, "records points parameters"],
    used: Bool[np.ndarray, "records points"],
    force_kN: Float[np.ndarray, "records points"],
) -> Misfit:
    """Return how far each record is off its curve.

    Parameters
    ----------
    residual_kN, force_kN:
        Measured less curve, and measured; of points that are not used, anything finite.
    tangents:
        Derivative of the curve with respect to its parameters (`curve_tangents`).
    used:
        Which points count; those of a record are its first.

    Source: an F test of nested linear models, its noise inflated by (1 + rho) / (1 - rho), which is how much more of
    the slowest waves AR(1) noise has than white noise of its variance. rho is that of what is left, so that strongly
    correlated noise is called a course too where it is above `MISFIT_MOST`.
    """
    points = used.sum(axis=1)
    residual = np.where(used, residual_kN, 0.0)
    extent = np.ptp(np.where(used, force_kN, force_kN[:, :1]), axis=1)
    in_waves, rest, rho = map(np.asarray, _split(jnp.asarray(residual), tangents, jnp.asarray(used)))
    enough = points >= WAVE_POINTS
    spare = np.where(enough, points - WAVES - CURVE_PARAMETERS, 1)
    variance = rest / spare
    with np.errstate(divide="ignore", invalid="ignore"):
        square = np.sum(residual**2, axis=1) / points
        ratio = in_waves / WAVES / (variance * (1.0 + rho) / (1.0 - rho))
        p_value = np.where(enough, fdtrc(WAVES, spare, ratio), np.nan)
        return Misfit(
            np.sqrt(square) / extent,
            np.sqrt(np.maximum(square - np.where(enough, variance, 0.0), 0.0)) / extent,
            p_value,
        )


@partial(jax.jit, static_argnames="law")
def curve_tangents(
    u: Float[Array, " points"], k: Float[Array, ""], J: Float[Array, ""], beta: Float[Array, ""], law: str = EQUATION_2
) -> Float[Array, "points 4"]:
    """Return the derivatives of a law's force with respect to F_i, J, k and log beta at u (mm)."""

    def force(parameters: Float[Array, "4"]) -> Float[Array, " points"]:
        F_i, J, k, log_beta = parameters
        return F_i + LAWS[law](u, k=k, J=J, beta=jnp.exp(log_beta))

    return jax.jacfwd(force)(jnp.stack([jnp.zeros_like(k), J, k, jnp.log(beta)]))


@jax.jit
@jax.vmap
def _split(
    residual: Float[Array, " points"], tangents: Float[Array, "points parameters"], used: Bool[Array, " points"]
) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """Return the sums of squares of a record's residuals in the waves and in neither, and the latter's lag-1 rho."""
    columns = jnp.concatenate([tangents, waves(used)], axis=1) * used[:, None]
    size = jnp.linalg.norm(columns, axis=0)
    directions, _ = jnp.linalg.qr(columns / jnp.where(size > 0, size, 1.0))
    part = directions.T @ residual
    rest = jnp.where(used, residual - directions @ part, 0.0)
    square = jnp.sum(rest**2)
    # White noise that waves and parameters were taken out of has a negative one, by their number over that of points.
    taken = columns.shape[1] / jnp.sum(used)
    rho = jnp.sum(rest[1:] * rest[:-1]) / jnp.where(square > 0, square, 1.0)
    rho = rho + taken * (1.0 - jnp.maximum(rho, 0.0))
    return jnp.sum(part[tangents.shape[1] :] ** 2), square, jnp.clip(rho, 0.0, _LARGEST_RHO)


@jax.jit
def waves(used: Bool[Array, " points"]) -> Float[Array, "points waves"]:
    """Return cosines of a half to three periods along a record's used points, zero elsewhere."""
    along = (jnp.cumsum(used) - 0.5) / jnp.sum(used)
    return jnp.where(used[:, None], jnp.cos(jnp.pi * along[:, None] * jnp.arange(1, WAVES + 1)), 0.0)
