"""Probabilities in text: what draws cannot show is not stated."""

import pytest

from bayes_tyre.report.wording import probability_text


@pytest.mark.parametrize(
    ("p", "text"),
    [
        *((0.5, "0.500"), (0.9994, "0.999"), (0.0006, "0.001"), (float("nan"), "")),
        *((4000.5 / 4001, ">= 0.9998"), (0.5 / 4001, "<= 0.0002"), (0.9995, ">= 0.9995"), (0.0004, "<= 0.0004")),
        *((1.0, ">= 0.9999"), (0.0, "<= 0.0001"), (1 - 1e-12, ">= 0.9999"), (1e-12, "<= 0.0001")),
    ],
)
def test_a_probability_that_rounds_to_0_or_1_is_stated_as_a_bound(p, text):
    assert probability_text(p) == text


@pytest.mark.parametrize(("p", "text"), [(0.994, "0.99"), (0.9963, ">= 0.996"), (0.0037, "<= 0.004"), (0.25, "0.25")])
def test_fewer_decimals_give_a_bound_earlier(p, text):
    assert probability_text(p, 2) == text
