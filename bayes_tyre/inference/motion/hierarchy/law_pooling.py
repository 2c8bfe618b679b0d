"""Weights of force laws from the evidence of many records of one tyre: a tyre has one law, so that their logs add up.

A sum over records concentrates on one law however wrong all of them are: its differences grow with the number of
records, and so does what chance and misfit add to them. The weights are therefore averages over Bayesian bootstraps of
the records: near 0 or 1 where one law is ahead whichever records count more, spread where that depends on the records.
Of a single record they are the weights of that record. Every record has its own priors, of the extensions too: what the
records share counts once for each.
Sources: Huggins and Miller (2023), Reproducible model selection using bagged posteriors, Bayesian Analysis 18; Rubin
(1981), The Bayesian bootstrap, The Annals of Statistics 9.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

#: Bootstraps that weights are averaged over, with this seed: their error is 0.005 at most.
BOOTSTRAPS, SEED = 10_000, 20230
#: Bootstraps at a time: of thousands of records they take some 100 MB.
_AT_A_TIME = 1_000
#: Share of the records that must have a law's evidence, or reliable evidence, for the others to be left out.
LEAST_SHARE = 0.5


class Counted(NamedTuple):
    """Which records and laws a sum of evidence is of.

    Attributes
    ----------
    records:
        Shape (records,): those with the evidence of every law that counts.
    laws:
        Shape (laws,).
    reliable:
        Whether none of these records rests on evidence that is not.
    """

    records: Bool[np.ndarray, " records"]
    laws: Bool[np.ndarray, " laws"]
    reliable: bool


def counted(log_evidence: Float[np.ndarray, "records laws"], reliable: Bool[np.ndarray, "records laws"]) -> Counted:
    """Return which records and laws count.

    A law without evidence in more than half of the records does not count. Of the records, those count that have
    reliable evidence of all other laws; where these are fewer than half, all that have evidence. None is left out for
    what its evidence says, or for its misfit.

    Parameters
    ----------
    log_evidence:
        Of each record by each law; NaN where it has no posterior.
    reliable:
        Whether it comes from weights that have a mean.
    """
    known = np.isfinite(log_evidence)
    laws = known.mean(axis=0) >= LEAST_SHARE if len(known) else np.zeros(known.shape[1], bool)
    complete = known[:, laws].all(axis=1) & laws.any()
    sound = complete & reliable[:, laws].all(axis=1)
    enough = bool(sound.any() and sound.sum() >= LEAST_SHARE * complete.sum())
    return Counted(sound if enough else complete, laws, enough)


def pooled_weights(
    log_evidence: Float[np.ndarray, "records laws"], prior: Float[np.ndarray, " laws"]
) -> Float[np.ndarray, " laws"]:
    """Return how probable each law is for all records together, of sum 1.

    Parameters
    ----------
    log_evidence:
        Finite; of one record or more.
    prior:
        How probable each law is beforehand, of sum 1.
    """
    rng, total = np.random.default_rng(SEED), np.zeros(log_evidence.shape[1])
    # A constant of a record favours no law: without it the sums are small enough to have digits after the point.
    about_best = log_evidence - log_evidence.max(axis=1, keepdims=True)
    for _ in range(BOOTSTRAPS // _AT_A_TIME):
        gaps = rng.standard_exponential((_AT_A_TIME, len(about_best)))
        shares = gaps / gaps.sum(axis=1, keepdims=True)
        logs = len(about_best) * shares @ about_best + np.log(prior)
        total += np.exp(logs - np.logaddexp.reduce(logs, axis=1)[:, None]).sum(axis=0)
    return total / total.sum()


def weights_of_record(
    pooled: Float[np.ndarray, " laws"], usable: Bool[np.ndarray, " laws"]
) -> Float[np.ndarray, " laws"] | None:
    """Return the weights of a record's laws, of sum 1: those of all records, among the fits of this one.

    Parameters
    ----------
    pooled:
        Of all records together; NaN where no records count.
    usable:
        Whether the record has a posterior by a law, and moments. None is returned where none of these has a
        weight.
    """
    kept = np.where(usable & np.isfinite(pooled), pooled, 0.0)
    total = kept.sum()
    return kept / total if total > 0 else None
