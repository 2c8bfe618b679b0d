"""The outlier study: the rule and the mean do what they say, errors and coverage are counted right."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t

from bayes_tyre.studies.design import outlier_design
from bayes_tyre.studies.outliers import compare, draw_campaigns, overview_lines
from bayes_tyre.studies.repeat_means import RULES, mean_of_repeats

NEAR_PAIR, FAR = "rule: 3 x the others' difference", "rule: far from the others' mean"


@pytest.mark.parametrize(
    ("repeats", "left_out"),
    [
        ([2.0, 2.02, 2.6], {NEAR_PAIR, FAR}),
        ([2.0, 2.02, 2.3], {NEAR_PAIR}),
        ([2.0, 2.02, 2.15], set()),  # 7 %: too near, however well the others agree
        ([2.0, 2.2, 2.6], {FAR}),  # less than three times the others' difference
        ([2.0, 2.1, 2.2], set()),
    ],
)
def test_a_rule_leaves_out_the_repeat_it_says(repeats, left_out):
    for rule in RULES:
        told = mean_of_repeats(np.array([repeats]), "k", rule)
        kept = repeats[:2] if rule in left_out else repeats
        assert told.value[0] == pytest.approx(np.mean(kept))
        half = t.ppf(0.975, len(kept) - 1) * np.std(kept, ddof=1) / np.sqrt(len(kept))
        assert told.upper[0] - told.lower[0] == pytest.approx(2 * half)


def test_the_order_of_repeats_does_not_matter_and_one_at_most_is_left_out():
    rng = np.random.default_rng(0)
    three = np.exp(rng.normal(0, 0.5, (200, 3)))
    for rule in RULES:
        one, other = (mean_of_repeats(repeats, "k", rule) for repeats in (three, three[:, [2, 0, 1]]))
        np.testing.assert_allclose(one.value, other.value)
        assert np.isfinite(one.lower).all()


def test_students_interval_of_the_mean_covers_what_it_says_without_discordant_repeats():
    rng = np.random.default_rng(1)
    told = mean_of_repeats(1.0 + 0.04 * rng.standard_normal((4000, 3)), "k", "mean of three")
    inside = np.mean((told.lower <= 1.0) & (told.upper >= 1.0))
    # 4000 trials of 95 %: four standard errors, false alarm below 1e-4.
    assert inside == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 4000))


def test_campaigns_have_the_discordant_repeats_they_are_asked_for():
    design, kinds = outlier_design(), np.array(["scattered", "shifted"] * 100)
    truths = draw_campaigns(design, 0.15, kinds, np.random.default_rng(2))
    odd = truths["discordant"]
    assert odd.mean() == pytest.approx(0.15, abs=0.02)
    off = truths["k"] / truths["k_case"][:, design.factors.of_record]
    shifted = np.abs(off[1::2][odd[1::2]] - 1.0)
    assert np.mean(shifted > 0.1) > 0.95
    assert np.std(np.log(off[::2][odd[::2]])) == pytest.approx(0.24, rel=0.15)
    assert np.std(np.log(off[~odd])) == pytest.approx(0.04, rel=0.05)
    assert not draw_campaigns(design, 0.0, kinds, np.random.default_rng(2))["discordant"].any()


def test_errors_and_coverage_are_counted_over_the_cases_of_each_group():
    told = pd.DataFrame(
        {
            "campaign": [0, 0, 1, 1],
            "has_discordant": [False, True, False, False],
            "error": [0.0, 0.2, 0.0, 0.0],
            "covered": [True, False, True, True],
            "half_width": [0.1, 0.2, 0.1, 0.1],
        }
    ).assign(share=0.05, kind="shifted", parameter="k", method="posterior")
    table = compare(told).set_index("group")
    assert table.loc["all cases", "rmse"] == pytest.approx(0.1)
    assert table.loc["all cases", "coverage"] == 0.75
    assert table.loc["with a discordant repeat", "rmse"] == pytest.approx(0.2)
    assert table.loc["with a discordant repeat", "coverage"] == 0.0
    about, shares, errors = overview_lines(compare(told))
    assert about.startswith("k of a case: relative error (coverage of 95 % intervals)")
    assert shares.split("  ")[-1].strip() == "5 %"
    assert errors.split(maxsplit=1) == ["posterior", "10.0 % (75 %)"]
