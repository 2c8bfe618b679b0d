"""Repeats of cases of which only estimates are known: records and cases integrated out, choices summed out.

Where the log likelihood of a record is quadratic in the logarithms of its values, its value given its case, the case
given its linear predictor, the choice of discordant repeats and whether the case stands apart are known in closed form.
What is left to sample is what they are distributed by.
"""

from itertools import product
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float, Int

from bayes_tyre.inference.model.case_effects import CaseDistribution, sample_case_distribution, with_remainder
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, Hyperparameters, deterministic, deterministic_each
from bayes_tyre.inference.model.marginal_mixture import (
    MOST_REPEATS,
    Members,
    RepeatsOfCases,
    log_prior_of_choices,
    members_of,
    outlier_probability,
    picked,
)
from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_effects import sample_cases_given
from bayes_tyre.inference.model.repeat_distribution import judgeable


def can_collapse(factors: Factors, repeats: str) -> bool:
    """Return whether repeats of a kind of `bayes_tyre.inference.model.repeat_distribution.REPEATS` can be summed out.

    A Student-t has no closed form, and choices of many repeats are too many.
    """
    kind = judgeable(repeats, factors)
    return kind == "normal" or (kind == "mixture" and factors.repeats_to_sum_out <= MOST_REPEATS)


def collapse_repeats(
    estimates: QuadraticApproximation,
    factors: Factors,
    repeats: str,
    hyperparameters: Hyperparameters,
    priors: Priors = PRIORS,
) -> "CollapsedPosterior":
    """Sample what the cases are distributed by, given estimates of the records, and return what these leave open.

    Parameters
    ----------
    estimates:
        Log likelihood of the logarithms of each record's values; shape (records, parameters).
    factors, repeats, hyperparameters, priors:
        As `bayes_tyre.inference.model.record_effects.sample_records` has them; `can_collapse` says of which repeats.
    """
    about = sample_case_distribution(factors, hyperparameters, PARAMETERS, priors)
    mixed = judgeable(repeats, factors) == "mixture"
    weight = hyperparameters["discordant_weight"] if mixed else jnp.zeros(())
    members = members_of(factors, discordant=mixed)
    fn = CollapsedRepeats(about, estimates, weight, priors.discordant_widening, factors.of_record, members)
    posterior = fn.given()
    numpyro.factor("log_density_of_cases", posterior.log_density)
    return posterior


def sample_cases_of(
    collapsed: "CollapsedPosterior", log_values: Float[Array, "records parameters"], factors: Factors
) -> None:
    """Sample the logarithms of the cases' values given those of the records, and keep what is known of cases."""
    about, _, weight, widening, of_record, members = collapsed.repeats
    posterior = RepeatsOfCases(about, weight, widening, of_record, members).given(log_values)
    if members.choices.any():
        deterministic("outlier_probability", outlier_probability(posterior, members, factors))
    cases = sample_cases_given(posterior, about, PARAMETERS, with_remainder(factors, PARAMETERS))
    deterministic_each("*_case", PARAMETERS, jnp.exp(cases))


class CollapsedRepeats(NamedTuple):
    """Repeats of cases about their linear predictor, given estimates of the repeats.

    Attributes
    ----------
    about:
        What the cases, and repeats about them, are distributed by.
    estimates:
        Log likelihood of the logarithms of each record's values; shape (records, parameters).
    weight, widening:
        Probability that a repeat is discordant, and how many times `about.sd_repeat` it then scatters.
    of_record, members:
        The case of each record, and the records of each case.

    Source: as `bayes_tyre.inference.model.marginal_mixture.RepeatsOfCases`, with a normal more for each record.
    """

    about: CaseDistribution
    estimates: QuadraticApproximation
    weight: Float[Array, ""]
    widening: float
    of_record: Int[np.ndarray, " records"]
    members: Members

    def given(self) -> "CollapsedPosterior":
        """Return the density of the estimates, and what they leave open of cases and records."""
        centre, slope, precision = self._by_case()
        off = self.about.mean[:, None] - centre
        slope_off = jnp.sum(precision * off, axis=1)
        # Of each repeat if it is usual, and if it is discordant; axes: parameters, repeats, cases.
        sd_repeat = jnp.broadcast_to(self.about.sd_repeat[:, None], slope.shape)
        usual, discordant = (
            NormalPosterior(slope - slope_off, precision, widening * sd_repeat) for widening in (1.0, self.widening)
        )

        def total(of_usual: Array, of_discordant: Array) -> Array:
            """Return the sum over repeats for each choice; axes: the rest, choices, cases."""
            choices = self.members.choices.T[:, :, None]
            of_each = [
                jnp.where(choice, of_discordant[..., i, None, :], of_usual[..., i, None, :])
                for i, choice in enumerate(choices)
            ]
            return sum(of_each, jnp.zeros(()))

        slopes, precisions = (total(*both) for both in zip(usual.for_above(), discordant.for_above(), strict=True))
        of_choices = total(usual.log_marginal, discordant.log_marginal)
        of_choices = of_choices + log_prior_of_choices(self.members, self.weight)
        log_kinds, remainders = self._kinds_of_case()
        # Each kind of case with each choice; axes: parameters, kinds, choices, cases. Copied, not broadcast: the
        # gradient is then a sum that is one kernel with what follows, and not a reduction for each array.
        slopes, precisions = (jnp.stack([each] * len(log_kinds), axis=-3) for each in (slopes, precisions))
        cases = NormalPosterior(slopes, precisions, jnp.broadcast_to(remainders[:, :, None], slopes.shape))
        log_joint = of_choices + cases.log_marginal + log_kinds[:, None, None]
        log_total = logsumexp(log_joint, axis=(0, 1))
        at_predictor = jnp.sum((slope - 0.5 * slope_off) * off, axis=(0, 1))
        return CollapsedPosterior(self, at_predictor + log_total, log_joint - log_total, cases)

    def _kinds_of_case(self) -> tuple[Float[np.ndarray, " kinds"], Float[Array, "parameters kinds #cases"]]:
        """Return log probability, and standard deviations about the linear predictor, of each kind of case.

        A case may stand apart in any of its parameters, and estimates trade one against the other: each combination is
        a kind.
        """
        log_weight, remainder = self.about.remainders()
        kinds = np.array(list(product(range(len(log_weight)), repeat=len(self.about.mean)))).T
        of_each = [remainder[kind, parameter] for parameter, kind in enumerate(kinds)]
        return log_weight[kinds].sum(axis=0), jnp.stack(of_each)

    def _by_case(self) -> tuple[Array, Array, Array]:
        """Return centre, slope and precision of the estimates by repeat and case; axes: parameters, repeats, cases.

        All are zero where a case has fewer repeats, which says nothing.
        """
        present = self.members.present.T

        def arranged(of_records: Array) -> Array:
            first = jnp.moveaxis(of_records, 0, -1)[..., self.members.records.T]
            return jnp.where(present, first, 0.0)

        less_offset = self.estimates._replace(centre=self.estimates.centre - self.about.offset)
        centre, slope, precision = (arranged(part) for part in less_offset)
        return centre, slope, precision


class CollapsedPosterior(NamedTuple):
    """What estimates of the repeats leave open: the choices, the cases given each, and the records given these.

    Attributes
    ----------
    repeats:
        What they are the posterior of.
    log_density:
        Shape (cases,): log density of the estimates.
    log_choice:
        Log probability of each kind of case with each choice of discordant repeats.
    cases:
        Of the logarithms of the cases' values about their linear predictor; axes: parameters, kinds, choices, cases.
    """

    repeats: CollapsedRepeats
    log_density: Float[Array, " cases"]
    log_choice: Float[Array, "kinds choices cases"]
    cases: NormalPosterior

    def draw(
        self,
        of_choice: Float[Array, " cases"],
        of_cases: Float[Array, "parameters cases"],
        of_records: Float[Array, "count parameters records"],
    ) -> Float[Array, "2 count records parameters"]:
        """Draw choices and cases, and given one of each so many values of the logarithms of each record.

        The second half is antithetic to the first: the same choices, with case and records as far on the other side of
        their means, so that odd terms cancel in the mean of both.

        Parameters
        ----------
        of_choice, of_cases, of_records:
            Standard normals to draw each by.
        """
        repeats = self.repeats
        # Kinds and choices in a row, the choices running faster.
        log_choice = self.log_choice.reshape(-1, self.log_choice.shape[-1])
        choice = picked(log_choice, of_choice)
        choices = jnp.asarray(repeats.members.choices)
        discordant = choices[choice[repeats.of_record] % len(choices), repeats.members.place]
        sd_repeat = jnp.where(discordant, repeats.widening, 1.0) * repeats.about.sd_repeat[:, repeats.of_record]
        mean, precision = repeats.about.mean, jnp.moveaxis(repeats.estimates.precision, 0, -1)

        def side(sign: float) -> Array:
            cases = self.cases.draw(sign * of_cases[:, None, None]).reshape(len(mean), *log_choice.shape)
            drawn = jnp.take_along_axis(cases, choice[None, None], axis=1)[:, 0]
            above = (mean + drawn)[:, repeats.of_record] + repeats.about.offset.T
            records = NormalPosterior(repeats.estimates.slope_at(above.T).T, precision, sd_repeat)
            return jnp.moveaxis(above + jax.vmap(records.draw)(sign * of_records), 1, -1)

        return jnp.stack([side(1.0), side(-1.0)])
