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

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors

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


def find_members(factors: Factors, kind: str) -> Members | None:
    """Return the members of the cases, for repeats that scatter as a ``mixture``; None if not summable.

    Choices of more repeats than `MOST_REPEATS` are too many. A Student-t has no closed form, and normal repeats have
    no modes that it would be needed for.
    """
    most = int(factors.repeats.max())
    if kind != "mixture" or most > MOST_REPEATS:
        return None
    records = np.zeros((len(factors.cases), most), dtype=int)
    present = np.zeros(records.shape, dtype=bool)
    place = np.zeros(len(factors.of_record), dtype=int)
    for case in range(len(factors.cases)):
        members = np.flatnonzero(factors.of_record == case)
        records[case, : len(members)], present[case, : len(members)] = members, True
        place[members] = np.arange(len(members))
    return Members(records, present, place, np.array(list(product((False, True), repeat=most)), dtype=bool))


class ChoicePosterior(NamedTuple):
    """What the values of a case's repeats leave open: its own value, and which of them are discordant.

    Attributes
    ----------
    log_choice:
        Log probability of each choice.
    mean, sd:
        Of the logarithm of the case's value about its linear predictor, given the choice.
    """

    log_choice: Float[Array, "choices cases"]
    mean: Float[Array, "choices parameters cases"]
    sd: Float[Array, "choices parameters cases"]


def marginalise(
    deviation: Float[Array, "records parameters"],
    offset: Float[Array, "parameters cases"],
    scatter: Float[Array, "parameters cases"],
    remainder: Float[Array, "parameters #cases"],
    weight: Float[Array, ""],
    members: Members,
    widening: float = DISCORDANT_WIDENING,
) -> ChoicePosterior:
    """Return what the values of the repeats say of each choice with the case's value integrated out, and of that.

    Parameters
    ----------
    deviation, offset:
        The logarithms of the records' values about a level of their case, and that level about what the case's words
        predict: apart, for scatter may be far smaller than what lies between the two.
    scatter, remainder:
        Standard deviation of usual repeats about their case; and of cases about their linear predictor, 0 where a
        case is no more than these.
    weight:
        Prior probability that a repeat is discordant.
    members:
        Of the cases.
    widening:
        How many times `scatter` discordant repeats scatter.

    Source: the normal hierarchy with known scales, Gelman et al. (2013), Bayesian Data Analysis, section 5.4, for each
    choice; the choices weigh as in any mixture of normals.
    """
    own = jnp.where(jnp.asarray(members.present), deviation.T[:, members.records], 0.0)
    widenings = np.where(members.choices, widening, 1.0)
    # Axes: choices, parameters, cases, repeats. A repeat counts as so many usual ones.
    counts = (members.present / widenings[:, None, :] ** 2)[:, None]
    count = counts.sum(axis=-1)
    mean = jnp.sum(counts * own, axis=-1) / np.where(count > 0, count, 1.0)
    within = jnp.sum(counts * (own - mean[..., None]) ** 2, axis=-1)
    precision = count / scatter**2
    gain = 1.0 + remainder**2 * precision
    middle = offset + mean
    of_each = -0.5 * (within / scatter**2 + precision * middle**2 / gain + jnp.log(gain))
    # Counted beforehand: as a product of two matrices XLA 0.12 got it wrong on CPUs when a hundred draws went together.
    discordant, usual = (choices.astype(float) @ members.present.T for choices in (members.choices, ~members.choices))
    log_widening = len(scatter) * np.log(widening) * discordant
    # A repeat that is not there is never discordant.
    impossible = np.where((members.choices @ (~members.present).T) > 0, -np.inf, 0.0)
    prior = xlogy(discordant, weight) + xlog1py(usual, -weight)
    log_joint = jnp.sum(of_each, axis=1) + prior + (impossible - log_widening)
    variance = remainder**2 / gain
    return ChoicePosterior(log_joint - logsumexp(log_joint, axis=0), variance * precision * middle, jnp.sqrt(variance))


def chosen(found: ChoicePosterior, discordant: Bool[Array, " records"], members: Members) -> Float[Array, " cases"]:
    """Return the log probability of the choice that calls just these records discordant, given the repeats' values."""
    here = jnp.asarray(members.present) & discordant[members.records]
    number = here @ 2 ** np.arange(here.shape[1])[::-1]  # choices count up as binary numbers do
    return jnp.take_along_axis(found.log_choice, number[None, :], axis=0)[0]


def draw_cases(
    found: ChoicePosterior, choosing: Float[Array, " cases"], z: Float[Array, "parameters cases"]
) -> Float[Array, "parameters cases"]:
    """Return the logarithms of the cases' values about their linear predictor, drawn given the repeats'.

    `choosing` and `z` are standard normals: one picks the choice, the others the values.
    """
    upto = jnp.cumsum(jnp.exp(found.log_choice), axis=0)
    chosen = jnp.minimum(jnp.sum(upto < ndtr(choosing), axis=0), len(upto) - 1)
    mean, sd = (jnp.take_along_axis(each, chosen[None, None, :], axis=0)[0] for each in (found.mean, found.sd))
    return mean + sd * z


def outlier_probability(found: ChoicePosterior, members: Members, factors: Factors) -> Float[Array, " records"]:
    """Return the probability that each record is discordant, given the values of all repeats of its case."""
    by_place = jnp.sum(jnp.exp(found.log_choice)[:, :, None] * members.choices[:, None, :], axis=0)
    return jax.lax.stop_gradient(by_place)[factors.of_record, members.place]
