"""Where the search along the profile over log beta starts: the lowest valleys of its RSS, by trying many betas."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.parameters import F_I, C, K
from bayes_tyre.inference.least_squares.small_linear_algebra import rest_of_last
from bayes_tyre.inference.least_squares.starting_values import LINEAR, SCANNED_BETAS
from bayes_tyre.inference.least_squares.variable_projection import Optimum, Profile

#: Betas tried, from 100 travels down to 1e-5, as `SCANNED_BETAS`; how many of them while beta falls to its half.
_BETAS, _AN_OCTAVE = 72, 3
#: Of a longer record the first points are taken one by one, for they tell small betas; in all so many, or a few less.
_FIRST_POINTS, _POINTS = 64, 160
#: The others are put together with their neighbours, if none is this many times as far from d_i as another of them.
_FARTHEST_TOGETHER = 2.0
#: A second valley counts if it may end below this many times what the first one has: the RSS of some points is not
#: that of all.
_MUCH_HIGHER = 2.0
#: Rounding of the RSS, as a part of the sum of squares that it is left of.
_ROUNDING = 1e-10


class Scanned(NamedTuple):
    """Where to start.

    Attributes
    ----------
    log_betas:
        Shape (2,); the logs of the betas at the bottom of the two lowest valleys, or of the one twice.
    second_counts:
        Whether the second valley may end lower than the first.
    """

    log_betas: Float[Array, "2"]
    second_counts: Bool[Array, ""]


def scanned(profile: Profile, least: Optimum, free: tuple[int, ...], beside: str | None = None) -> Scanned:
    """Return the two lowest valleys of the RSS over log beta, of those tried.

    Two, for the lower of two narrow valleys may lie between betas that are both higher than the other's bottom.

    Parameters
    ----------
    profile, free:
        The record; indices into `PARAMETERS` of those to fit.
    least:
        The best fit for the least beta.
    beside:
        Name of the axis that records lie side by side on, where they do.
    """
    sums, rounding = _sums_of_all_or_fewer(profile, least, free, beside)
    around = jnp.pad(sums, 1, mode="reflect")  # at either end as if it went on as it came
    before, behind = around[:-2], around[2:]
    number, lowest = jnp.arange(len(sums)), jnp.argmin(sums)
    valley = ((number == 0) | (sums < before)) & (sums <= behind) & (number != lowest)
    other = jnp.where(jnp.any(valley), jnp.argmin(jnp.where(valley, sums, jnp.inf)), lowest)
    both = jnp.stack([lowest, other])
    # A parabola through three neighbours is lowest at most half a step, and an eighth of its bend, from the middle one.
    bend = before + behind - 2.0 * sums
    steps = 0.5 * (before - behind) / jnp.where(bend > 0, bend, jnp.inf)
    places = both + jnp.nan_to_num(jnp.clip(steps, -0.5, 0.5))[both]
    bottom = sums[other] - 0.5 * bend[other]
    counts = (other != lowest) & ~(bottom > _MUCH_HIGHER * sums[lowest] + rounding)
    return Scanned(jnp.log(SCANNED_BETAS[1]) - places * (jnp.log(2.0) / _AN_OCTAVE), counts)


Sums = tuple[Float[Array, " betas"], Float[Array, ""]]
"""The RSS at every beta tried, infinite where it is not finite, and its rounding."""


def _sums_of_all_or_fewer(profile: Profile, least: Optimum, free: tuple[int, ...], beside: str | None) -> Sums:
    """Return the sums over fewer points; of records side by side over all, where one has neighbours too far apart."""
    if len(profile.d) <= _POINTS:
        return _sums(profile, profile.one, least, free)
    fewer, weight, apart = _thinned(profile)
    if beside is not None:  # one answer for all: of two branches only one is then computed
        apart = jax.lax.pmax(apart.astype(int), beside) > 0
    return jax.lax.cond(
        apart, lambda: _sums(profile, profile.one, least, free), lambda: _sums(fewer, weight, least, free)
    )


def _sums(profile: Profile, weight: Float[Array, " some"], least: Optimum, free: tuple[int, ...]) -> Sums:
    """Return the sums over points that stand for so many each.

    Each column, and what the best fit for the least beta leaves of the force, is p + q E, E = exp(-|d - d_i| / beta):
    their inner products are sums of E and E^2, one matrix product for all betas, and E^2 is the E of half the beta.
    Such products lose digits, but only of what beta changes of the forces.
    """
    k, c, level = least.value[jnp.array((K, C, F_I))]
    line, nothing = k * profile.d + c * profile.one, jnp.zeros_like(profile.d)
    columns = {K: (profile.d, -profile.d), C: (profile.one, -profile.one), F_I: (nothing, profile.one)}
    rows = [*(columns[i] for i in LINEAR if i in free), (profile.F - line, line - level * profile.one)]
    pairs = [(a, b) for i, a in enumerate(rows) for b in rows[: i + 1]]
    with_E = [weight * (p * other_q + q * other_p) for (p, q), (other_p, other_q) in pairs]
    with_square = [weight * q * other_q for (_, q), (_, other_q) in pairs]
    rates = 2.0 ** (jnp.arange(_BETAS + _AN_OCTAVE) / _AN_OCTAVE) / SCANNED_BETAS[1]
    moments = jnp.exp(-profile.distance * rates[:, None]) @ jnp.stack(with_E + with_square, axis=1)
    once, twice = moments[:_BETAS, : len(pairs)], moments[_AN_OCTAVE:, len(pairs) :]
    alone = jnp.stack([jnp.sum(weight * p * other_p) for (p, _), (other_p, _) in pairs])
    products = iter((alone + once + twice).T)
    sums = rest_of_last([[next(products) for _ in range(i + 1)] for i in range(len(rows))])
    return jnp.where(jnp.isfinite(sums), sums, jnp.inf), _ROUNDING * jnp.sum(weight * profile.F**2)


def _thinned(profile: Profile) -> tuple[Profile, Float[Array, " some"], Bool[Array, ""]]:
    """Return a profile of fewer points, for how many each stands, and whether some are too far apart for that.

    Neighbours are put at their mean: along a path the curve hardly bends between them, and noise stays what it is.
    """
    behind = len(profile.d) - _FIRST_POINTS
    together = -(-behind // (_POINTS - _FIRST_POINTS))

    def groups(row: Float[Array, " points"]) -> Float[Array, "groups together"]:
        return jnp.pad(row[_FIRST_POINTS:], (0, -behind % together)).reshape(-1, together)

    def summed(row: Float[Array, " points"]) -> Float[Array, " some"]:
        return jnp.concatenate([row[:_FIRST_POINTS], jnp.sum(groups(row), axis=1)])

    weight = summed(profile.one)
    distance, d, F = (summed(row) / jnp.maximum(weight, 1.0) for row in (profile.distance, profile.d, profile.F))
    reach = groups(profile.distance)
    nearest = jnp.min(jnp.where(groups(profile.one) > 0, reach, jnp.inf), axis=1)
    apart = jnp.any(jnp.max(reach, axis=1) > _FARTHEST_TOGETHER * nearest)
    one = jnp.where(weight > 0, 1.0, 0.0)
    return profile._replace(distance=distance, one=one, d=d, F=F), weight, apart
