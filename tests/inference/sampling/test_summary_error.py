"""How far summaries are off: what a regression on the sampled sites finds of a known error."""

import numpy as np
import pytest

from bayes_tyre.inference.model.collapsed.model import SUMMARY_ERROR
from bayes_tyre.inference.sampling.summary_error import SummaryError, summary_error

CHAINS, DRAWS, CASES = 4, 1000, ["a", "b", "c"]
NOISE = 0.3


def made(slope: float, draws: int = DRAWS) -> dict[str, np.ndarray]:
    """Return draws of twelve unknowns, the first of which moves the error of the second case by so much."""
    random = np.random.default_rng(0)
    sites = {
        "terms_z": random.standard_normal((CHAINS, draws, 10)),
        "log_sigma": random.standard_normal((CHAINS, draws)),
    }
    sites["weight"] = random.uniform(size=(CHAINS, draws, 1))
    missed = NOISE / np.sqrt(3) * random.standard_normal((CHAINS, draws, len(CASES)))
    missed[..., 1] += slope * sites["terms_z"][..., 0]
    return sites | {SUMMARY_ERROR: missed}


SAMPLED = ("terms_z", "log_sigma", "weight")


def test_an_error_that_follows_what_is_shared_is_found_in_its_case():
    found = summary_error(made(0.2), SAMPLED, CASES)
    # The error's variance of 0.04 is known to 2 noise^2 sqrt(2 p) / n + 4 slope noise / sqrt(n): within 0.02 of 0.2.
    assert found.total == pytest.approx(0.2, abs=0.02)
    assert found.of_case == pytest.approx(0.2, abs=0.02)
    assert found.case == "b"
    assert 0.15 < found.at_least < found.total


def test_what_draws_miss_by_themselves_is_no_error_of_what_is_shared():
    found = summary_error(made(0.0), SAMPLED, CASES)
    # Chance explains 13 / 4000 of the variance, which is taken off: a standard deviation of 0.011 is left of 0.3.
    assert found.total < 0.03
    assert found.at_least == 0.0


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_of_unknowns_more_than_draws_each_is_taken_by_itself(slope):
    random, found = np.random.default_rng(1), []
    for _ in range(20):
        sites = {"terms_z": random.standard_normal((4, 100, 1000)), "log_sigma": random.standard_normal((4, 100, 30))}
        missed = random.standard_normal((4, 100, len(CASES))) / np.sqrt(len(CASES))
        missed[..., 1] += slope * sites["terms_z"][..., 7]
        found.append(summary_error(sites | {SUMMARY_ERROR: missed}, ("terms_z", "log_sigma"), CASES))
    squares = np.array([[one.total, one.at_least] for one in found]) ** 2
    # By chance 1000 unknowns explain (1 + slope^2) sqrt(2000) / 400 of the variance, give or take: 0.11 to 0.14, of
    # which the mean of 20, with what is negative set to zero, is within 0.1 but once in a thousand.
    assert squares[:, 0].mean() == pytest.approx(slope**2, abs=0.1)
    assert (squares[:, 1] <= squares[:, 0]).all()
    assert squares[:, 1].mean() < slope**2 + 0.01


def test_of_too_few_draws_all_is_error():
    found = summary_error(made(0.0, draws=5), SAMPLED, CASES)
    assert found.chance == np.inf
    assert found.at_least == found.total == pytest.approx(NOISE, rel=0.6)


def test_of_draws_that_miss_so_much_that_nothing_can_be_told_all_is_error():
    sites = made(0.0)
    sites[SUMMARY_ERROR] = 1e4 * sites[SUMMARY_ERROR]
    found = summary_error(sites, SAMPLED, CASES)
    # A standard deviation from 4000 normals is within 1.2 % of its value, 1e4 NOISE.
    assert found.at_least == found.total == pytest.approx(1e4 * NOISE, rel=0.05)


def test_a_density_that_is_nowhere_is_no_summary():
    sites = made(0.0)
    sites[SUMMARY_ERROR][1, 7, 2] = -np.inf
    found = summary_error(sites, SAMPLED, CASES)
    assert found.at_least == np.inf
    assert found.case == "c"


def test_slopes_say_how_large_the_error_is_and_what_is_chance():
    random, known = np.random.default_rng(2), SummaryError(0.9, 0.0, "dual (0)20-30", 0.001, 0.1)
    root = np.tril(random.uniform(0.1, 0.3, (6, 6)))
    points = random.standard_normal((50, 6)) @ root.T
    slope, found = np.linspace(-0.05, 0.2, 6), []
    for _ in range(200):
        slopes = slope + random.standard_normal((100, 6)) @ np.diag([0.1, 0.1, 0.1, 0.1, 0.5, 0.5])
        found.append(known.by_slopes(slopes, points))
    assert (found[0].case, found[0].of_case) == ("dual (0)20-30", 0.001)
    expected, squares = float(slope @ np.cov(points.T) @ slope), np.array([one.total for one in found]) ** 2
    # Means of 200, within four of their own standard errors; the spread of 200 is known within 5 %.
    assert squares.mean() == pytest.approx(expected, abs=4 * squares.std() / np.sqrt(200))
    assert np.mean([one.chance for one in found]) == pytest.approx(squares.std(), rel=0.2)
    for one in found:
        assert one.at_least == pytest.approx(np.sqrt(max(one.total**2 - 2 * one.chance, 0.0)))


def test_slopes_of_nothing_show_no_error():
    random, known = np.random.default_rng(3), SummaryError(0.9, 0.0, "dual (0)20-30", 0.001, 0.1)
    points = random.standard_normal((100, 6))
    found = [known.by_slopes(random.standard_normal((100, 6)), points) for _ in range(50)]
    # Beyond two standard errors of a mean of squares in a few of a hundred.
    assert sum(one.at_least > 0.0 for one in found) <= 8


def test_points_fewer_than_unknowns_or_all_one_do_not_matter():
    slopes = np.random.default_rng(4).standard_normal((100, 6))
    error = SummaryError(0.9, 0.0, "a", 0.001, 0.1)
    assert error.by_slopes(slopes, np.ones((20, 6))).total == 0.0
    assert np.isfinite(error.by_slopes(slopes, np.random.default_rng(5).standard_normal((3, 6))).total)


def test_slopes_that_are_no_numbers_are_an_error_without_end():
    slopes = np.ones((100, 6))
    slopes[7, 2] = np.nan
    found = SummaryError(0.0, 0.0, "a", 0.0).by_slopes(slopes, slopes)
    assert found.at_least == found.total == np.inf


@pytest.mark.parametrize(("chance", "least"), [(0.1, 0.4), (np.inf, 0.0)])
def test_what_the_regression_can_tell_beside_the_slopes_counts(chance, least):
    points = np.random.default_rng(6).standard_normal((100, 6))
    assert SummaryError(0.9, 0.4, "a", 0.001, chance).by_slopes(np.zeros((100, 6)), points).at_least == least


def test_what_is_in_the_density_already_is_no_error():
    sites = made(0.2)
    in_density = 0.2 * sites["terms_z"][..., 0].ravel()
    found = summary_error(sites, SAMPLED, CASES, in_density)
    assert found.total < 0.03
    assert found.of_case == pytest.approx(0.2, abs=0.02)


def test_it_comes_back_from_json():
    error = SummaryError(0.02, 0.0, "dual (0)20-30", 0.001)
    assert SummaryError.from_json(error.to_json()) == error
