"""The repeats of cases with the case's value integrated out and the choice of discordant repeats summed out.

Where one of three repeats is discordant, the value of the case has a mode for each answer to which one it is, and NUTS
crosses from one to the other too seldom. Given the repeats' own values both are known in closed form: a normal for each
choice, and for each answer to whether the case stands apart from the others. So the sampler never meets them. Each draw
of the repeats is given its case afterwards, exactly, by standard normals that depend on nothing.
"""

from itertools import product
from typing import NamedTuple, override

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtr
from jaxtyping import Array, ArrayLike, Bool, Float, Int
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import constraints

from bayes_tyre.inference.model.case_effects import CaseDistribution
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


def find_members(factors: Factors, kind: str, apart: bool) -> Members | None:
    """Return the members of the cases, for repeats that scatter as a ``mixture`` or ``normal``; None if not summable.

    Choices of more repeats than `MOST_REPEATS` are too many. A Student-t has no closed form. Where repeats are normal
    and no case can stand `apart`, there are no modes that it would be needed for.
    """
    if kind == "student" or (kind == "normal" and not apart):
        return None
    if kind == "mixture" and factors.repeats_to_sum_out > MOST_REPEATS:
        return None
    return members_of(factors, discordant=kind == "mixture")


def members_of(factors: Factors, discordant: bool) -> Members:
    """Return the members of the cases, with every choice of discordant repeats, or with the one that none is."""
    most = int(factors.repeats.max())
    records = np.zeros((len(factors.cases), most), dtype=int)
    present = np.zeros(records.shape, dtype=bool)
    place = np.zeros(len(factors.of_record), dtype=int)
    for case in range(len(factors.cases)):
        members = np.flatnonzero(factors.of_record == case)
        records[case, : len(members)], present[case, : len(members)] = members, True
        place[members] = np.arange(len(members))
    each = (False, True) if discordant else (False,)
    return Members(records, present, place, np.array(list(product(each, repeat=most)), dtype=bool))


class ChoicePosterior(NamedTuple):
    """What the values of a case's repeats leave open: its own value, its kind, and which of them are discordant.

    Attributes
    ----------
    log_density:
        Log density of the repeats' values, over all choices.
    log_choice:
        Log probability of each choice.
    log_kind:
        Log probability that the case is a usual one, or stands apart, in each parameter, given the choice.
    mean, sd:
        Of the logarithm of the case's value about its linear predictor, given kind and choice.
    """

    log_density: Float[Array, " cases"]
    log_choice: Float[Array, "choices cases"]
    log_kind: Float[Array, "kinds choices parameters cases"]
    mean: Float[Array, "kinds choices parameters cases"]
    sd: Float[Array, "kinds choices parameters cases"]


class RepeatsOfCases(dist.Distribution):
    """The logarithms of the values of all records, as repeats of cases about their linear predictor.

    Each record is discordant with the same probability, and then scatters more widely about its case. Event shape
    (records, parameters).

    Parameters
    ----------
    about:
        What the cases, and usual repeats about them, are distributed by.
    weight:
        Probability that a repeat is discordant.
    widening:
        How many times `about.sd_repeat` discordant repeats scatter.
    of_record, members:
        The case of each record, and the records of each case.

    Source: the normal hierarchy with known standard deviations, Gelman et al. (2013), Bayesian Data Analysis, section
    5.4, for each choice; the choices weigh as in any mixture of normals.
    """

    support = constraints.real_matrix  # pyright: ignore[reportAssignmentType]  (as all of NumPyro's)

    def __init__(
        self,
        about: CaseDistribution,
        weight: Float[Array, ""],
        widening: float,
        of_record: Int[np.ndarray, " records"],
        members: Members,
    ) -> None:
        self.about, self.weight, self.widening = about, weight, widening
        self.of_record, self.members = of_record, members
        super().__init__(event_shape=(len(of_record), len(about.mean)), validate_args=False)

    @override
    def sample(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample records parameters"]:
        """Draw the cases, which of their repeats are discordant, and the repeats."""
        of_case, which, of_repeat = jax.random.split(key, 3)
        cases = jnp.moveaxis(self.about.draw_cases(of_case, sample_shape), -1, -2)[..., self.of_record, :]
        discordant = jax.random.bernoulli(which, self.weight, (*sample_shape, len(self.of_record), 1))
        sd = jnp.where(discordant, self.widening, 1.0) * self.about.sd_repeat.T[self.of_record]
        return cases + self.about.offset + sd * jax.random.normal(of_repeat, cases.shape)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, ""]:
        """Return the log density of all records' values, cases and choices summed out."""
        return jnp.sum(self.given(jnp.asarray(value)).log_density)

    def given(self, value: Float[Array, "records parameters"]) -> ChoicePosterior:
        """Return the density of the repeats' values, and what they leave open of their cases."""
        members, sd_repeat = self.members, self.about.sd_repeat
        deviation = (value - self.about.offset - self.about.mean.T[self.of_record]).T
        own = jnp.where(jnp.asarray(members.present), deviation[:, members.records], 0.0)
        widenings = np.where(members.choices, self.widening, 1.0)
        # Axes: choices, parameters, cases, repeats. A repeat counts as so many usual ones.
        counts = (members.present / widenings[:, None, :] ** 2)[:, None]
        count = counts.sum(axis=-1)
        mean = jnp.sum(counts * own, axis=-1) / np.where(count > 0, count, 1.0)
        within = jnp.sum(counts * (own - mean[..., None]) ** 2, axis=-1)
        precision = count / sd_repeat**2
        # Given the choice parameters are independent, and so is whether a case stands apart in each: the first axis.
        log_weight, remainder = self.about.remainders()
        remainder = remainder[:, None]
        gain = 1.0 + remainder**2 * precision
        log_kinds = jnp.asarray(log_weight)[:, None, None, None] - 0.5 * (precision * mean**2 / gain + jnp.log(gain))
        log_case = logsumexp(log_kinds, axis=0)
        log_each = log_case - 0.5 * within / sd_repeat**2
        # A choice widens the volume of those repeats that it calls discordant.
        log_widening = len(sd_repeat) * np.log(self.widening) * _count(members.choices, members.present)
        log_joint = jnp.sum(log_each, axis=1) + log_prior_of_choices(members, self.weight) - log_widening
        log_total = logsumexp(log_joint, axis=0)
        # What all choices share.
        log_volume = members.present.sum(axis=1) * jnp.sum(jnp.log(sd_repeat) + 0.5 * np.log(2.0 * np.pi), axis=0)
        # No root of a variance: its slope is infinite where a case is no more than its linear predictor.
        sd = remainder / jnp.sqrt(gain)
        log_choice, log_kind = log_joint - log_total, log_kinds - log_case
        return ChoicePosterior(log_total - log_volume, log_choice, log_kind, sd**2 * precision * mean, sd)


def log_prior_of_choices(members: Members, weight: Float[Array, ""]) -> Float[Array, "choices cases"]:
    """Return the log probability of each choice beforehand, each repeat being discordant with probability `weight`."""
    choices, present = members.choices, members.present
    # A repeat that is not there is never discordant.
    impossible = jnp.asarray(np.where(_count(choices, ~present) > 0, -np.inf, 0.0))
    if not choices.any():  # normal repeats: the weight is no unknown
        return impossible
    # Two logarithms, not two for each choice in each case.
    log_weight, log_rest = jnp.log(weight), jnp.log1p(-weight)
    return impossible + _count(choices, present) * log_weight + _count(~choices, present) * log_rest


def _count(
    choices: Bool[np.ndarray, "choices repeats"], present: Bool[np.ndarray, "cases repeats"]
) -> Float[np.ndarray, "choices cases"]:
    """Return how many repeats both name, of each choice in each case."""
    # Counted in numpy: XLA 0.12 got a product of two matrices wrong on CPUs when a hundred draws went together.
    return choices.astype(float) @ present.T


def choice_number(discordant: Bool[Array, " records"], members: Members) -> Int[Array, " cases"]:
    """Return which choice calls just these records discordant, in each case."""
    here = jnp.asarray(members.present) & discordant[members.records]
    return here @ 2 ** np.arange(here.shape[1])[::-1]  # choices count up as binary numbers do


def case_given_choice(
    posterior: ChoicePosterior, choice: Int[Array, " cases"], kind: Int[Array, "parameters cases"]
) -> tuple[Float[Array, "parameters cases"], Float[Array, "parameters cases"]]:
    """Return mean and standard deviation of the cases about their linear predictor, given choice and kind of each."""
    mean, sd = (
        jnp.take_along_axis(_of_choice(each, choice), kind[None], axis=0)[0] for each in (posterior.mean, posterior.sd)
    )
    return mean, sd


def _of_choice(
    values: Float[Array, "kinds choices parameters cases"], choice: Int[Array, " cases"]
) -> Float[Array, "kinds parameters cases"]:
    return jnp.take_along_axis(values, choice[None, None, None], axis=1)[:, 0]


def draw_cases(
    posterior: ChoicePosterior,
    of_choice: Float[Array, " cases"],
    of_kind: Float[Array, "parameters cases"],
    z: Float[Array, "parameters cases"],
) -> Float[Array, "parameters cases"]:
    """Return the logarithms of the cases' values about their linear predictor, drawn given the repeats'.

    The arguments are standard normals: one picks the choice, others the kinds, the last the values.
    """
    choice = picked(posterior.log_choice, of_choice)
    kind = picked(_of_choice(posterior.log_kind, choice), of_kind)
    mean, sd = case_given_choice(posterior, choice, kind)
    return mean + sd * z


def picked(log_probability: Float[Array, "some *units"], z: Float[Array, "*units"]) -> Int[Array, "*units"]:
    """Return which of some alternatives, of these log probabilities, a standard normal picks."""
    up_to = jnp.cumsum(jnp.exp(log_probability), axis=0)
    return jnp.minimum(jnp.sum(up_to < ndtr(z), axis=0), len(up_to) - 1)


def outlier_probability(posterior: ChoicePosterior, members: Members, factors: Factors) -> Float[Array, " records"]:
    """Return the probability that each record is discordant, given the values of all repeats of its case."""
    by_place = jnp.sum(jnp.exp(posterior.log_choice)[:, :, None] * members.choices[:, None, :], axis=0)
    return jax.lax.stop_gradient(by_place)[factors.of_record, members.place]


def apart_probability(posterior: ChoicePosterior) -> Float[Array, "parameters cases"]:
    """Return the probability that each case stands apart from the others, given the values of its repeats."""
    of_choices = jnp.exp(posterior.log_choice[:, None] + posterior.log_kind[-1])
    return jax.lax.stop_gradient(jnp.sum(of_choices, axis=0))
