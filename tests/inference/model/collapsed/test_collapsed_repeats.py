"""Repeats and cases integrated out, choices summed out: against multivariate normals of all estimates of a case."""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from scipy.special import logsumexp

from bayes_tyre.inference.model.case_effects import CaseDistribution
from bayes_tyre.inference.model.collapsed.repeats import CollapsedPosterior, CollapsedRepeats, can_collapse
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.marginal_mixture import members_of
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation

WIDENING, WEIGHT = 6.0, 0.1
APART_WIDENING, APART_WEIGHT = 5.0, 0.2
#: Repeats of each case.
REPEATS = (3, 1, 2)


def factors_of(repeats: tuple[int, ...] = REPEATS) -> Factors:
    rows = [{"configuration": "single", "speed_km_h": float(case)} for case, n in enumerate(repeats) for _ in range(n)]
    return find_factors(pd.DataFrame(rows))


def made(seed: int, discordant: bool = True, remainder: float = 0.3, apart: bool = True) -> CollapsedRepeats:
    """Return repeats of cases with estimates whose values trade against each other."""
    factors, random = factors_of(), np.random.default_rng(seed)
    records, cases = len(factors.of_record), len(factors.cases)
    rows = random.standard_normal((records, 2, 2)) / 0.2
    centre = random.normal(0.0, 0.5, (records, 2))
    estimates = QuadraticApproximation(
        jnp.asarray(centre), jnp.asarray(random.standard_normal((records, 2))), jnp.asarray(rows @ rows.mT)
    )
    about = CaseDistribution(
        jnp.asarray(random.normal(0.0, 0.3, (2, cases))),
        jnp.asarray([[remainder], [0.0]]),
        jnp.asarray(random.uniform(0.05, 0.4, (2, cases))),
        APART_WEIGHT if apart else 0.0,
        APART_WIDENING,
        random.normal(0.0, 0.3, (records, 2)),
    )
    weight = jnp.asarray(WEIGHT if discordant else 0.0)
    return CollapsedRepeats(about, estimates, weight, WIDENING, factors.of_record, members_of(factors, discordant))


def by_hand(
    repeats: CollapsedRepeats, case: int, discordant: bool
) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """Return the log weight of each kind of case with each choice; mean and covariance of all estimates given both."""
    members = np.flatnonzero(repeats.of_record == case)
    mean, remainder, scatter = (np.asarray(part) for part in repeats.about[:3])
    apart, logs, normals = repeats.about.apart_weight, [], []
    kinds = product((False, True) if apart else (False,), repeat=2)
    choices = product((False, True) if discordant else (False,), repeat=len(members))
    for kind, choice in product(kinds, choices):
        sd = np.where(kind, APART_WIDENING, 1.0) * remainder[:, 0]
        covariance = np.kron(np.ones((len(members),) * 2), np.diag(sd**2))
        for i, (record, odd) in enumerate(zip(members, choice, strict=True)):
            own = np.linalg.inv(repeats.estimates.precision[record])
            own = own + np.diag((scatter[:, case] * (WIDENING if odd else 1.0)) ** 2)
            covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += own
        odd = sum(choice)
        log = odd * np.log(WEIGHT) + (len(choice) - odd) * np.log1p(-WEIGHT) if discordant else 0.0
        logs.append(log + sum(kind) * np.log(apart or 1.0) + (2 - sum(kind)) * np.log1p(-apart))
        normals.append(
            (np.concatenate([mean[:, case] + repeats.about.offset[record] for record in members]), covariance)
        )
    return np.array(logs), normals


def _logpdf(at: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    off = at - mean
    return -0.5 * float(off @ np.linalg.solve(covariance, off) + np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def maxima(repeats: CollapsedRepeats, case: int) -> tuple[np.ndarray, float]:
    """Return where the log likelihood of each of a case's records is largest, and the logarithm of its integral."""
    at, log_integral = [], 0.0
    for record in np.flatnonzero(repeats.of_record == case):
        centre, slope, precision = (np.asarray(part)[record] for part in repeats.estimates)
        at.append(centre + np.linalg.solve(precision, slope))
        log_integral += 0.5 * slope @ np.linalg.solve(precision, slope)
        log_integral -= 0.5 * np.linalg.slogdet(precision / (2.0 * np.pi))[1]
    return np.concatenate(at), log_integral


@pytest.mark.parametrize("discordant", [True, False])
@pytest.mark.parametrize("remainder", [0.3, 0.0])
@pytest.mark.parametrize("apart", [True, False])
def test_the_density_is_that_of_a_mixture_of_normals(discordant, remainder, apart):
    for seed in range(3):
        repeats = made(seed, discordant, remainder, apart)
        posterior = repeats.given()
        for case in range(len(REPEATS)):
            logs, normals = by_hand(repeats, case, discordant)
            at, log_integral = maxima(repeats, case)
            each = np.array([log + _logpdf(at, *normal) for log, normal in zip(logs, normals, strict=True)])
            # Choices that call a repeat discordant which is not there have no weight.
            log_choice = np.asarray(posterior.log_choice)[..., case].ravel()
            possible = np.isfinite(log_choice)
            np.testing.assert_allclose(log_choice[possible], each - logsumexp(each), rtol=1e-8, atol=1e-9)
            assert float(posterior.log_density[case]) == pytest.approx(
                np.log(np.exp(each - each.max()).sum()) + each.max() + log_integral, rel=1e-9
            )


@pytest.mark.parametrize("discordant", [True, False])
@pytest.mark.parametrize("remainder", [0.3, 0.0])
def test_gradients_are_those_of_finite_differences(discordant, remainder):
    """In all that a case's density depends on."""
    repeats, step = made(4, discordant, remainder), 1e-6
    values = {name: getattr(repeats.about, name) for name in ("mean", "remainder", "sd_repeat")}
    values |= {name: getattr(repeats.estimates, name) for name in ("slope", "precision")}
    if discordant:
        values["weight"] = repeats.weight

    def density(values: dict[str, jax.Array]) -> jax.Array:
        about = repeats.about._replace(**{name: values[name] for name in ("mean", "remainder", "sd_repeat")})
        estimates = repeats.estimates._replace(slope=values["slope"], precision=values["precision"])
        weight = values.get("weight", repeats.weight)
        return repeats._replace(about=about, estimates=estimates, weight=weight).given().log_density.sum()

    slopes, difference = jax.grad(density)(values), jax.jit(density)
    for name, value in values.items():
        for place in np.ndindex(*value.shape):
            by = {sign: difference({**values, name: value.at[place].add(sign * step)}) for sign in (-1, 1)}
            # Of second order in the step: 1e-12 of a third derivative of some 1e3, and rounding of 1e-16 / 1e-6.
            expected = float(by[1] - by[-1]) / (2 * step)
            assert float(slopes[name][place]) == pytest.approx(expected, rel=1e-6, abs=1e-6), (name, place)


def draws_of(posterior: CollapsedPosterior, count: int, seed: int) -> np.ndarray:
    """Return draws of the records' values and their mirror images, shape (count, 2, records, parameters)."""
    random, cases = np.random.default_rng(seed), len(REPEATS)
    shapes = (cases,), (2, cases), (1, 2, len(posterior.repeats.of_record))
    z = [jnp.asarray(random.standard_normal((count, *shape))) for shape in shapes]
    return np.asarray(jax.jit(jax.vmap(lambda *each: posterior.draw(*each)[:, 0]))(*z))


def test_draws_of_records_have_the_moments_of_their_normal():
    repeats, draws = made(5, discordant=False, apart=False), 4000
    posterior = repeats.given()
    drawn, mirrored = np.moveaxis(draws_of(posterior, draws, seed=0), 1, 0)
    # One choice and one kind of case each: the mean of both sides is the posterior's, in every draw.
    np.testing.assert_allclose(np.ptp(drawn + mirrored, axis=0), 0.0, atol=1e-9)
    for case in range(len(REPEATS)):
        members = np.flatnonzero(repeats.of_record == case)
        _, ((above, total),) = by_hand(repeats, case, False)
        at, _ = maxima(repeats, case)
        own = np.zeros_like(total)
        for i, record in enumerate(members):
            own[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = np.linalg.inv(repeats.estimates.precision[record])
        # Records given estimates: prior covariance is the estimates' less their own.
        gain = (total - own) @ np.linalg.inv(total)
        mean, covariance = above + gain @ (at - above), own - own @ np.linalg.inv(total) @ own
        found = drawn[:, members].reshape(draws, -1)
        sd = np.sqrt(np.diag(covariance))
        # 12 means and 12 standard deviations, near normal: one beyond 4.5 standard errors in 2e-4 of seeds.
        assert (np.abs(found.mean(axis=0) - mean) < 4.5 * sd / np.sqrt(draws)).all()
        assert (np.abs(found.std(axis=0) / sd - 1.0) < 4.5 / np.sqrt(2 * draws)).all()


def test_draws_of_records_have_the_density_that_is_claimed():
    repeats, draws = made(6), 20_000
    posterior = repeats.given()
    # The mean over draws of a ratio to another density of the same records is 1, if they are drawn as they should be:
    # here that with other estimates of the records, whose likelihoods and marginals are known.
    slope = repeats.estimates.slope + 0.3
    other = repeats._replace(estimates=repeats.estimates._replace(slope=slope))
    drawn = draws_of(posterior, draws, seed=1)[:, 0]
    log_ratio = jax.vmap(lambda values: other.estimates.at(values) - repeats.estimates.at(values))(drawn)
    by_case = np.stack([log_ratio[:, repeats.of_record == case].sum(axis=1) for case in range(len(REPEATS))])
    ratio = np.exp(by_case - np.asarray(other.given().log_density - posterior.log_density)[:, None])
    # As likely off by 5 standard errors in any of three cases as 2e-6.
    assert (np.abs(ratio.mean(axis=1) - 1.0) < 5 * ratio.std(axis=1) / np.sqrt(draws)).all()


def test_what_can_be_collapsed():
    assert can_collapse(factors_of(), "mixture")
    assert can_collapse(factors_of(), "normal")
    assert can_collapse(factors_of((2, 1)), "student")  # two repeats cannot tell: they are normal
    assert not can_collapse(factors_of(), "student")
    assert not can_collapse(factors_of((7, 1)), "mixture")
    assert not can_collapse(factors_of((7, 1)).only(np.arange(8) > 0), "mixture")  # the model of all eight
