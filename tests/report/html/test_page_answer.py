"""The first sentences of the page: which is stiffer, by how much, how sure, and what limits the answer."""

import dataclasses
import re
from html import unescape

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid
from helpers.pages import numbers_in, page_of, plain
from helpers.reported_results import REASON, made, printed_factors

from bayes_tyre.record import EITHER_LAW
from bayes_tyre.report.answer.caveats import caveats
from bayes_tyre.report.answer.formatting import percent_apart, probability, rounded
from bayes_tyre.report.answer.headline import headline
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.answer.ratios import UNLIKE_CASES
from bayes_tyre.report.html import tables


def test_the_stiffer_configuration_is_named_with_how_much_and_how_sure(two):
    first, _ = map(plain, headline(two))
    assert first.startswith("Configuration dual is 33 % stiffer than single, averaged over the 4 test cases of both")
    assert "the probability that it is stiffer at all is above 99 %" in first
    ratio, low, high = numbers_in(first)
    row = two.contrasts.query("contrast == 'dual / single' and parameter == 'k'").iloc[0]
    assert (ratio, low, high) == tuple(round(row[name], 2) for name in ("median", "lower", "upper"))


def test_means_over_unlike_cases_are_named_as_such(two):
    assert UNLIKE_CASES not in page_of(two)
    cases = two.cases
    first = cases[cases["configuration"] == "dual"].iloc[0]
    fewer = cases[~((cases["configuration"] == "dual") & (cases["step_kN"] == first["step_kN"]))]
    assert UNLIKE_CASES in page_of(dataclasses.replace(two, cases=fewer))


def test_the_sentence_has_the_direction_of_the_table_and_a_reference_turns_both(away):
    result = made(away / "turned", {"a": 1.0, "b": 2.5})
    first, _ = map(plain, headline(result))
    assert first.startswith("Configuration a is 0.40 times as stiff as b")
    assert "the probability that it is softer at all is above 99 %" in first
    turned = result.referred_to("a")
    first, _ = map(plain, headline(turned))
    assert first.startswith("Configuration b is 2.5")
    assert "times as stiff as a" in first
    assert numbers_in(first)[0] == pytest.approx(2.5, rel=0.01)
    assert set(turned.contrasts["contrast"]) == {"b / a", "loading / unloading"}
    assert next(row[0].text for row in tables.contrasts_table([turned]).rows) == "b / a"


def test_an_interval_that_holds_1_is_no_difference(away):
    result = made(away / "alike", {"single": 1.5, "dual": 1.505}, spread=0.05)
    first, _ = map(plain, headline(result))
    assert first.startswith("These data do not tell which of ")
    assert "contains 1 (no difference)" in first
    assert "stiffer than" not in first
    assert any(said.startswith("A difference in k between dual and single") for said in caveats(result))


def test_a_failed_verdict_stands_before_the_answer(away):
    result = made(away / "failed", {"single": 1.5, "dual": 2.0}, verdict="fail")
    assert headline(result)[0].startswith("Not to be relied on, for the fit failed its checks: configuration dual is")
    assert caveats(result)[0].startswith("Any number of this result")
    page = page_of(result)
    assert "Verdict: fail. Do not use these numbers." in page
    assert in_words(REASON) in unescape(page)
    assert "Verdict: pass" not in page


def test_one_configuration_and_one_direction(away):
    factor_table = grid(("only",), 1)
    one = made(away / "one", {"only": 1.5}, factor_table=factor_table)
    first, second = map(plain, headline(one))
    assert first.startswith("The stiffness k is 1.6")
    assert "kN/mm for only in loading (95 % interval" in first
    assert second.startswith("Loading against unloading: over the same span of load, loading is 10 % stiffer")
    referred, _ = headline(one.referred_to("only"))
    assert referred.endswith("; no configuration is there to compare with only.")
    down = factor_table[factor_table["direction"] == "unloading"].reset_index(drop=True)
    assert headline(made(away / "down", {"only": 1.5}, factor_table=down))[1] == (
        "All steps are unloading, so loading cannot be compared."
    )


def test_records_without_words(away):
    factor_table = pd.DataFrame({"record": ["a", "b", "c"]})
    first, second = map(plain, headline(made(away / "wordless", {"": 1.5}, factor_table=factor_table)))
    assert re.match(r"The stiffness k is 1\.\d+ kN/mm for all records \(95 % interval", first)
    assert second.startswith("The records do not say which steps were loading")


def test_without_loads_the_reason_is_that_and_not_that_they_differ(away):
    no_loads = grid(("only",), 1).drop(columns="initial_load_kN")
    assert headline(made(away / "no_loads", {"only": 1.5}, factor_table=no_loads))[1] == (
        "The records do not say from which load they start, so loading and unloading are not compared."
    )


def test_configurations_without_a_case_in_common_are_not_compared(away):
    factor_table = grid(("a", "b"), 1)
    factor_table["speed_km_h"] += np.where(factor_table["configuration"] == "a", 0.0, 5.0)
    first, _ = headline(made(away / "apart", {"a": 1.0, "b": 2.0}, factor_table=factor_table))
    assert first.startswith("The 2 configurations have no test case in common, so none is compared; the stiffness k is")


def test_of_three_configurations_the_two_farthest_apart_are_compared(away):
    result = made(away / "three", {"a": 1.5, "b": 1.0, "c": 1.8})
    first, _ = map(plain, headline(result))
    assert first.startswith("Two of 3 configurations are farthest apart: configuration b is 44 % softer than c")
    to_a, _ = map(plain, headline(result.referred_to("a")))
    assert to_a.startswith("Of 3 configurations one is farthest from a: configuration b is 33 % softer than a")


def test_the_printed_tables_model_has_an_answer_and_no_repeats(away):
    factor_table = printed_factors("single", "dual")
    result = made(away / "printed", {"single": 1.5, "dual": 2.0}, factor_table=factor_table, origin="published")
    assert "33" in headline(result)[0]
    assert any("whatever their processing did" in said for said in caveats(result))
    page = page_of(result)
    assert "Published: numbers as printed" in page
    assert "No rows for &ldquo;Repeats" in page


def test_a_law_that_the_records_do_not_tell_from_another_is_no_reason_to_believe_beta(two):
    note = EITHER_LAW + "equation_2 from small_step_limit, with which it is 1.16 times as large"
    limited = dataclasses.replace(two, diagnostics={**two.diagnostics, "limitations": ["k: another", note]})
    of_law = [said for said in caveats(limited) if said.startswith("The interval of beta as one for either law")]
    assert len(of_law) == 1
    assert "do not tell Equation 2 from its limit for small steps, with which it is 1.16 times as large." in of_law[0]
    assert len(caveats(limited)) == len(caveats(two)) + 1


def test_what_the_prior_decides_is_said_in_the_answer(two):
    rows = two.summary["parameter"] == "k_mean"
    summary = two.summary.assign(decided_by=two.summary["decided_by"].where(~rows, "prior"))
    first, _ = headline(dataclasses.replace(two, summary=summary))
    assert "; but k of dual in loading is decided by the prior, not by the data" in first
    assert first.endswith("2 more likewise.")
    every = two.summary.assign(decided_by=two.summary["decided_by"].where(two.summary["decided_by"].isna(), "both"))
    alone = [
        said for said in caveats(dataclasses.replace(two, summary=every)) if said.startswith("That the data alone")
    ]
    assert len(alone) == 1
    assert "k of dual in loading depends on the prior too" in alone[0]
    assert "beta of dual in loading depends on the prior too" in alone[0]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *((0.0, "0"), (1.0, "1.000"), (0.0289941, "0.02899"), (12345.6, "12346"), (-1.38512, "\N{MINUS SIGN}1.385")),
        *((9.99996, "10.00"), (3.2e-9, "3.200e\N{MINUS SIGN}09"), (float("nan"), "")),
    ],
)
def test_numbers_are_rounded_for_reading(value, text):
    assert rounded(value) == text


def test_percentages_and_probabilities_claim_no_more_than_they_know():
    assert [plain(percent_apart(ratio)) for ratio in (1.314, 1.0432, 0.9, 1.0996)] == ["31 %", "4.3 %", "10 %", "10 %"]
    assert [plain(probability(p)) for p in (1.0, 0.994, 0.5, 0.0)] == ["above 99 %", "99 %", "50 %", "below 1 %"]
