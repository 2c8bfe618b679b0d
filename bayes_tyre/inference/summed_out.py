"""A case and its repeats with the case's value integrated out and the choice of discordant repeats summed out.

Where one of three repeats is odd, the value of the case has a mode for each answer to which one it is, and NUTS crosses
from one to the other too seldom. Given the repeats' own values both are known in closed form: a normal for each choice.
So the sampler never meets them. Each draw of the repeats is given its case and its choice afterwards, exactly: by
standard normals that are sampled beside the rest and depend on nothing.
"""

from itertools import product
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtr, xlog1py, xlogy
from jaxtyping import Array, Bool, Float, Int

from bayes_tyre.inference.levels import Levels
from bayes_tyre.inference.priors import DISCORDANT_WIDENING

#: With more repeats in a case the choices, two to their number, are too many.
MOST_REPEATS = 6


class Members(NamedTuple):
    """Which records repeat each case, and which of them each choice calls discordant.

    Attributes
    ----------
    records:
        Index of each repeat of each case; 0 where a case has fewer.
    present:
        Whether it has that many.
    place:
        Of each record among the repeats of its case.
    choices:
        Which repeats each choice calls discordant.
    """

    records: Int[np.ndarray, "cases repeats"]
    present: Bool[np.ndarray, "cases repeats"]
    place: Int[np.ndarray, " records"]
    choices: Bool[np.ndarray, "choices repeats"]


def find_members(levels: Levels, kind: str) -> Members | None:
    """Return the members of the cases, for repeats that scatter as a ``mixture`` or ``normal``; None if not summable.

    Choices of more repeats than `MOST_REPEATS` are too many, and a Student-t has no closed form.
    """
    most = int(levels.repeats.max())
    if kind not in ("mixture", "normal") or (kind == "mixture" and most > MOST_REPEATS):
        return None
    records = np.zeros((len(levels.cases), most), dtype=int)
    present = np.zeros(records.shape, dtype=bool)
    place = np.zeros(len(levels.of_record), dtype=int)
    for case in range(len(levels.cases)):
        members = np.flatnonzero(levels.of_record == case)
        records[case, : len(members)], present[case, : len(members)] = members, True
        place[members] = np.arange(len(members))
    choices = list(product((False, True), repeat=most)) if kind == "mixture" else [(False,) * most]
    return Members(records, present, place, np.array(choices, dtype=bool))


class SummedOut(NamedTuple):
    """The repeats of each case, whatever its value and whichever of them are discordant.

    Attributes
    ----------
    log_density:
        Of the logarithms of their values.
    log_choice:
        Log probability of each choice, given their values.
    mean, sd:
        Of the logarithm of the case's value about what its words predict, given the repeats' values and the choice.
    """

    log_density: Float[Array, " cases"]
    log_choice: Float[Array, "choices cases"]
    mean: Float[Array, "choices parameters cases"]
    sd: Float[Array, "choices parameters cases"]


def sum_out(
    deviation: Float[Array, "records parameters"],
    offset: Float[Array, "parameters cases"],
    scatter: Float[Array, "parameters cases"],
    remainder: Float[Array, "parameters #cases"],
    weight: Float[Array, ""] | float,
    members: Members,
) -> SummedOut:
    """Return the repeats of each case with its value and their discordance summed out.

    Parameters
    ----------
    deviation, offset:
        The logarithms of the records' values about a level of their case, and that level about what the case's words
        predict: apart, for scatter may be far smaller than what lies between the two.
    scatter, remainder:
        Standard deviation of usual repeats about their case; and of cases about what their words predict, 0 where a
        case is no more than these.
    weight:
        Prior probability that a repeat is discordant; 0 where all are usual.
    members:
        Of the cases.

    Source: the normal hierarchy with known scales, Gelman et al. (2013), Bayesian Data Analysis, section 5.4, for each
    choice; the choices weigh as in any mixture of normals.
    """
    here = jnp.asarray(members.present)
    own = jnp.where(here, deviation.T[:, members.records], 0.0)
    widening = np.where(members.choices, DISCORDANT_WIDENING, 1.0)
    # Axes: choices, parameters, cases, repeats.
    precision = here / (widening[:, None, None, :] * scatter[..., None]) ** 2
    total = jnp.sum(precision, axis=-1)
    known = jnp.asarray(members.present.any(axis=1))
    mean = jnp.sum(precision * own, axis=-1) / jnp.where(known, total, 1.0)
    within = jnp.sum(precision * (own - mean[..., None]) ** 2, axis=-1)
    gain = 1.0 + remainder**2 * total
    middle = offset + mean
    log_scales = members.present.sum(axis=1) * jnp.log(scatter) + (np.log(widening) @ members.present.T)[:, None, :]
    of_each = -0.5 * (within + total * middle**2 / gain + jnp.log(gain)) - log_scales
    # Counted beforehand: as a product of two matrices XLA 0.12 got it wrong on CPUs when a hundred draws went together.
    discordant, usual = (choices.astype(float) @ members.present.T for choices in (members.choices, ~members.choices))
    prior = xlogy(discordant, weight) + xlog1py(usual, -weight)
    # A repeat that is not there is never discordant.
    impossible = np.where((members.choices @ (~members.present).T) > 0, -np.inf, 0.0)
    log_joint = jnp.sum(of_each, axis=1) + prior + impossible
    log_density = logsumexp(log_joint, axis=0)
    volume = 0.5 * np.log(2.0 * np.pi) * members.present.sum(axis=1) * len(scatter)
    variance = remainder**2 / gain
    return SummedOut(log_density - volume, log_joint - log_density, variance * total * middle, jnp.sqrt(variance))


def draw_cases(
    found: SummedOut, choosing: Float[Array, " cases"], z: Float[Array, "parameters cases"]
) -> Float[Array, "parameters cases"]:
    """Return the logarithms of the cases' values about what their words predict, drawn given the repeats'.

    `choosing` and `z` are standard normals: one picks the choice, the others the values.
    """
    upto = jnp.cumsum(jnp.exp(found.log_choice), axis=0)
    chosen = jnp.minimum(jnp.sum(upto < ndtr(choosing), axis=0), len(upto) - 1)
    mean, sd = (jnp.take_along_axis(each, chosen[None, None, :], axis=0)[0] for each in (found.mean, found.sd))
    return mean + sd * z


def discordant_probability(found: SummedOut, members: Members, levels: Levels) -> Float[Array, " records"]:
    """Return the probability that each record is discordant, given the values of all repeats of its case."""
    by_place = jnp.sum(jnp.exp(found.log_choice)[:, :, None] * members.choices[:, None, :], axis=0)
    return jax.lax.stop_gradient(by_place)[levels.of_record, members.place]
