"""Grid search over beta: the two lowest local minima of the RSS profile, as starts for Newton's method.

The RSS at all betas of the grid comes from one matrix product, over fewer, averaged points of a long record.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.parameters import F_I, C, K
from bayes_tyre.inference.least_squares.small_linear_algebra import residual_of_last
from bayes_tyre.inference.least_squares.starting_values import LINEAR, SCANNED_BETAS
from bayes_tyre.inference.least_squares.variable_projection import Optimum, Profile

#: Betas of the grid, from 100 travels down to 1e-5, as `SCANNED_BETAS`; and how many of them an octave.
_BETAS, _PER_OCTAVE = 72, 3
#: Most points of a record. Of a longer record the first points, which identify small betas, stay as they are and the
#: others are averaged in blocks.
_FIRST_POINTS, _POINTS = 64, 160
#: Largest ratio of distances from d_i within a block of averaged points; beyond it all points are used.
_LARGEST_RATIO = 2.0
#: The second minimum is searched if its RSS may be below this many times that of the first, because the RSS over
#: averaged points is not that over all.
_MUCH_HIGHER = 2.0
#: Rounding error of the RSS, relative to the sum of squared forces.
_ROUNDING = 1e-10


class GridMinima(NamedTuple):
    """The two lowest local minima of the RSS on the grid of betas.

    Attributes
    ----------
    log_betas:
        Shape (2,); log betas of the two lowest minima, lowest first; of a single minimum twice.
    second_counts:
        Whether the second minimum may be lower than the first off the grid.
    """

    log_betas: Float[Array, "2"]
    second_counts: Bool[Array, ""]


def grid_minima(profile: Profile, least: Optimum, free: tuple[int, ...], axis_name: str | None = None) -> GridMinima:
    """Return the two lowest local minima of the RSS over log beta, on a grid.

    Two, because a narrow minimum between two grid points may be lower than the lowest grid point.

    Parameters
    ----------
    profile, free:
        The record; indices into `PARAMETERS` of those to fit.
    least:
        The best fit at the least beta.
    axis_name:
        Name of the `jax.vmap` axis of records, where they are vectorised.
    """
    sums, rounding = _sums_on_grid(profile, least, free, axis_name)
    around = jnp.pad(sums, 1, mode="reflect")
    before, behind = around[:-2], around[2:]
    number, lowest = jnp.arange(len(sums)), jnp.argmin(sums)
    is_minimum = ((number == 0) | (sums < before)) & (sums <= behind) & (number != lowest)
    other = jnp.where(jnp.any(is_minimum), jnp.argmin(jnp.where(is_minimum, sums, jnp.inf)), lowest)
    both = jnp.stack([lowest, other])
    # The vertex of the parabola through three neighbours: within half a step and an eighth of its second difference.
    bend = before + behind - 2.0 * sums
    steps = 0.5 * (before - behind) / jnp.where(bend > 0, bend, jnp.inf)
    places = both + jnp.nan_to_num(jnp.clip(steps, -0.5, 0.5))[both]
    bottom = sums[other] - 0.5 * bend[other]
    counts = (other != lowest) & ~(bottom > _MUCH_HIGHER * sums[lowest] + rounding)
    return GridMinima(jnp.log(SCANNED_BETAS[1]) - places * (jnp.log(2.0) / _PER_OCTAVE), counts)


Sums = tuple[Float[Array, " betas"], Float[Array, ""]]
"""The RSS at every beta of the grid, infinite where it is not finite, and its rounding error."""


def _sums_on_grid(profile: Profile, least: Optimum, free: tuple[int, ...], axis_name: str | None) -> Sums:
    """Return the sums over averaged points, or over all points where those of one record are too far apart."""
    if len(profile.d) <= _POINTS:
        return _sums(profile, profile.one, least, free)
    averaged, weight, apart = _averaged(profile)
    if axis_name is not None:  # one predicate for all records: only one branch is then computed
        apart = jax.lax.pmax(apart.astype(int), axis_name) > 0
    return jax.lax.cond(
        apart, lambda: _sums(profile, profile.one, least, free), lambda: _sums(averaged, weight, least, free)
    )


def _sums(profile: Profile, weight: Float[Array, " some"], least: Optimum, free: tuple[int, ...]) -> Sums:
    """Return the sums over weighted points.

    Each column, and the residual of the best fit at the least beta, is p + q E with E = exp(-|d - d_i| / beta). Their
    inner products are sums of E and E^2, one matrix product for all betas, where E^2 is the E of half the beta. The
    products lose digits, but only of the small effect of beta on the forces.
    """
    k, c, level = least.value[jnp.array((K, C, F_I))]
    line, nothing = k * profile.d + c * profile.one, jnp.zeros_like(profile.d)
    columns = {K: (profile.d, -profile.d), C: (profile.one, -profile.one), F_I: (nothing, profile.one)}
    rows = [*(columns[i] for i in LINEAR if i in free), (profile.F - line, line - level * profile.one)]
    pairs = [(a, b) for i, a in enumerate(rows) for b in rows[: i + 1]]
    with_E = [weight * (p * other_q + q * other_p) for (p, q), (other_p, other_q) in pairs]
    with_square = [weight * q * other_q for (_, q), (_, other_q) in pairs]
    rates = 2.0 ** (jnp.arange(_BETAS + _PER_OCTAVE) / _PER_OCTAVE) / SCANNED_BETAS[1]
    moments = jnp.exp(-profile.distance * rates[:, None]) @ jnp.stack(with_E + with_square, axis=1)
    once, twice = moments[:_BETAS, : len(pairs)], moments[_PER_OCTAVE:, len(pairs) :]
    alone = jnp.stack([jnp.sum(weight * p * other_p) for (p, _), (other_p, _) in pairs])
    products = iter((alone + once + twice).T)
    sums = residual_of_last([[next(products) for _ in range(i + 1)] for i in range(len(rows))])
    return jnp.where(jnp.isfinite(sums), sums, jnp.inf), _ROUNDING * jnp.sum(weight * profile.F**2)


def _averaged(profile: Profile) -> tuple[Profile, Float[Array, " some"], Bool[Array, ""]]:
    """Return a profile of fewer points, the number of points in each, and whether some are too far apart for that.

    Blocks of neighbours are replaced by their mean, between which the curve is nearly straight.
    """
    others = len(profile.d) - _FIRST_POINTS
    size = -(-others // (_POINTS - _FIRST_POINTS))

    def blocks(row: Float[Array, " points"]) -> Float[Array, "blocks size"]:
        return jnp.pad(row[_FIRST_POINTS:], (0, -others % size)).reshape(-1, size)

    def summed(row: Float[Array, " points"]) -> Float[Array, " some"]:
        return jnp.concatenate([row[:_FIRST_POINTS], jnp.sum(blocks(row), axis=1)])

    weight = summed(profile.one)
    distance, d, F = (summed(row) / jnp.maximum(weight, 1.0) for row in (profile.distance, profile.d, profile.F))
    reach = blocks(profile.distance)
    nearest = jnp.min(jnp.where(blocks(profile.one) > 0, reach, jnp.inf), axis=1)
    apart = jnp.any(jnp.max(reach, axis=1) > _LARGEST_RATIO * nearest)
    one = jnp.where(weight > 0, 1.0, 0.0)
    return profile._replace(distance=distance, one=one, d=d, F=F), weight, apart
