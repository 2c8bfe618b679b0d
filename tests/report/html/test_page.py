"""The report's page without a browser: what it says for each kind of result, that labels are text, and its bytes."""

import base64
import dataclasses
import re
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import drawn
from helpers.hand_made_posteriors import grid
from helpers.reported_results import IMAGE, REASON, SCRIPT, made, printed_factors, write_made

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.report.answer.caveats import caveats
from bayes_tyre.report.answer.formatting import percent_apart, probability, rounded
from bayes_tyre.report.answer.headline import headline
from bayes_tyre.report.answer.load import Reported, read_reported
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.answer.ratios import UNLIKE_CASES
from bayes_tyre.report.figures.page.svg import DENSE_MARKERS, svg
from bayes_tyre.report.html import tables
from bayes_tyre.report.html.between_results import ComparedResult, compare_results
from bayes_tyre.report.html.figures import embedded_figure
from bayes_tyre.report.html.page import Part, document

NBSP = "\N{NO-BREAK SPACE}"


@pytest.fixture(scope="module")
def away(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def two(away) -> Reported:
    return made(away / "two", {"single": 1.5, "dual": 2.0}, repeats=3)


@pytest.fixture(scope="module")
def hostile(away) -> Reported:
    factor_table = grid((SCRIPT, "single"), 1)
    factor_table.loc[0, "record"] = IMAGE
    return made(away / "hostile", {SCRIPT: 2.0, "single": 1.5}, factor_table=factor_table, verdict="fail")


def page_of(*results: Reported) -> str:
    return document([Part(result, [embedded_figure("contrasts", drawn("contrasts"))]) for result in results])


def plain(text: str) -> str:
    return text.replace(NBSP, " ")


def numbers_in(sentence: str) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.\d+", sentence)]


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
    assert "holds 1 (no difference)" in first
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
    assert second.startswith("Loading against unloading: over the same span of load loading is 10 % stiffer")
    down = factor_table[factor_table["direction"] == "unloading"].reset_index(drop=True)
    assert headline(made(away / "down", {"only": 1.5}, factor_table=down))[1] == (
        "All steps are unloading, so loading cannot be compared."
    )


def test_records_without_words(away):
    factor_table = pd.DataFrame({"record": ["a", "b", "c"]})
    first, second = map(plain, headline(made(away / "wordless", {"": 1.5}, factor_table=factor_table)))
    assert re.match(r"The stiffness k is 1\.\d+ kN/mm for all records \(95 % interval", first)
    assert second.startswith("The records do not say which steps were loading")


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


def test_parameters_of_another_command_are_columns_of_their_own(two):
    mass = two.cases[two.cases["parameter"] == "k"].assign(parameter="m", unit="kg", median=305.0)
    cases = pd.concat([two.cases, mass], ignore_index=True)
    result = dataclasses.replace(two, cases=cases)
    table = tables.cases_table([result])
    assert [(column.heading, column.unit) for column in table.columns][-3:] == [
        ("k", "kN/mm"),
        ("beta", "mm"),
        ("m", "kg"),
    ]
    assert all(row[-1].text == "305.0" for row in table.rows)
    assert "Mass that moves" in page_of(result)


def test_tables_hold_every_row_once_and_every_digit(two):
    contrasts = tables.contrasts_table([two])
    assert len(contrasts.rows) == len(two.contrasts) / 2
    assert all(cell.text for row in contrasts.rows for cell in row[-4:])
    repeats = tables.repeats_table([two])
    assert len(repeats.rows) == two.repeats["record"].nunique()
    k = [column.heading for column in repeats.columns].index("k")
    wanted = two.repeats[two.repeats["parameter"] == "k"]["median"].tolist()
    assert [float(row[k].value) for row in repeats.rows] == wanted
    assert repeats.columns[k - 1].heading == "outlier probability"
    assert all(row[k - 1].text for row in repeats.rows)


def test_outlier_probabilities_have_no_column_where_nothing_judges_and_the_page_says_so(two):
    nothing = two.repeats.assign(outlier_probability=np.nan)
    silent = Reported(**{**vars(two), "repeats": nothing})
    headings = [column.heading for column in tables.repeats_table([silent]).columns]
    assert "outlier probability" not in headings
    assert "k" in headings
    assert "nothing here says whether one is discordant" in tables.repeats_table([silent]).caption
    beside = tables.repeats_table([two, silent])
    assert [column.of_result for column in beside.columns if column.heading == "outlier probability"] == ["two"]
    assert "student or normal" in page_of(silent)


def test_two_results_stand_side_by_side_row_by_row(two, away):
    other = made(away / "later", {"single": 1.6, "dual": 2.0}, seed=8)
    table = tables.cases_table([two, other])
    assert [column.of_result for column in table.columns[-4:]] == ["two", "two", "later", "later"]
    assert len(table.rows) == two.cases["parameter"].eq("k").sum()
    assert all(cell.text for row in table.rows for cell in row)


def side(folder: Path) -> ComparedResult:
    result = read_reported(folder, folder.name)
    inputs = frozenset(result.run["inputs"].values())
    return ComparedResult(folder.name, read_tree(folder / "posterior.nc"), inputs, result.run["origin"])


def test_campaigns_are_compared_configuration_by_configuration(two, away):
    later = write_made(away / "next_year", {"single": 1.65, "dual": 2.0}, seed=9)
    found = compare_results(side(away / "two"), side(later), 0.95)
    single = next(ratio for ratio in found.ratios["k"] if ratio.above == "single (two)")
    # log k of a configuration has the standard deviation 0.02 in each, so their ratio 0.028.
    assert single.median == pytest.approx(1.5 / 1.65, rel=0.01)
    assert np.log(single.upper / single.lower) == pytest.approx(2 * 1.96 * 0.02 * np.sqrt(2), rel=0.15)
    page = document([Part(two, []), Part(read_reported(later, "next_year"), [])], [found])
    assert "Configuration single (two) is 9" in page
    assert "the test cases of both" in page


def test_a_single_tyre_is_compared_with_a_dual_pair_of_another_folder(away):
    folders = [write_made(away / name, {name: k}, seed=i) for i, (name, k) in enumerate([("lone", 1.5), ("pair", 2.0)])]
    ratio = compare_results(side(folders[0]), side(folders[1]), 0.95).ratios["k"][0]
    assert (ratio.above, ratio.below) == ("lone (lone)", "pair (pair)")
    assert ratio.median == pytest.approx(0.75, rel=0.01)


def test_what_is_not_independent_is_not_compared(two, away):
    one = side(away / "two")
    assert "fits of the same records" in compare_results(one, one._replace(name="again"), 0.95).limitation
    printed = one._replace(inputs=frozenset("x"), origin="published")
    found = compare_results(one._replace(origin="reconstructed"), printed, 0.95)
    assert not found.ratios
    assert "rest on the same printed tables" in found.limitation


def test_labels_are_text_and_never_markup(hostile):
    page = page_of(hostile)
    assert SCRIPT not in page
    assert "<img src=x" not in page
    assert page.count("<script") == 1
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt;") > 5
    assert "&lt;img src=x onerror=alert(2)&gt;" in page


def test_the_page_asks_for_nothing_outside_and_allows_nothing_else(two):
    page = page_of(two)
    assert "http://" not in page
    assert "https://" not in page
    assert "url(" not in page
    assert "@import" not in page
    assert all(value.startswith("data:") for value in re.findall(r'\bsrc="([^"]*)"', page))
    assert all(value.startswith(("#", "data:,")) for value in re.findall(r'\bhref="([^"]*)"', page))
    policy = unescape(re.findall(r'Content-Security-Policy" content="([^"]*)"', page)[0])
    assert policy.startswith("default-src 'none'; style-src 'sha256-")
    assert "unsafe" not in policy


def test_how_it_was_made_is_all_there(two):
    page = page_of(two)
    digest = next(iter(two.run["inputs"].values()))
    for said in (two.run["command"], digest, f"jax {two.run['versions']['jax']}", "largest R-hat"):
        assert said in page


def test_the_same_results_give_the_same_bytes(two, hostile):
    assert page_of(two, hostile) == page_of(two, hostile)


@pytest.mark.parametrize("name", ["pair_plot", "forest_of_cases"])
def test_the_same_figure_gives_the_same_bytes(name):
    figures = [svg(drawn.__wrapped__(name), name) for _ in range(2)]
    assert figures[0] == figures[1]
    text = figures[0].decode("utf-8")
    named = re.findall(r'\bid="([^"]+)"', text)
    assert len(set(named)) == len(named)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(named)


def test_a_figure_has_a_text_alternative_and_is_svg_without_its_labels_as_markup():
    shown = embedded_figure("contrasts", drawn("contrasts"))
    assert shown.alternative.startswith("Ratios between configurations")
    assert "Marker: median." in shown.alternative
    text = base64.b64decode(shown.uri.removeprefix("data:image/svg+xml;base64,")).decode()
    assert text.startswith("<?xml")
    assert "<!--" not in text
    assert "<text" not in text


def test_layers_with_many_markers_are_images_inside_the_svg():
    figure = drawn.__wrapped__("pair_plot")
    most = max(len(np.asarray(line.get_xydata())) for ax in figure.get_axes() for line in ax.lines)
    assert most > DENSE_MARKERS
    assert b"<image" in svg(figure, "pair_plot")
    assert b"<image" not in svg(drawn.__wrapped__("contrasts"), "contrasts")


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


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("run.json", "[1]", "run.json"),
        ("diagnostics.json", '{"verdict": "perhaps"}', "verdict"),
        ("cases.csv", "mean,sd\n1,2\n", "no column parameter"),
        ("cases.csv", "parameter,unit,median,lower,upper,interval\nk,kN/mm,x,y,z,w\n", "no numbers"),
    ],
)
def test_a_folder_that_holds_no_result_of_a_fit_is_refused(two, away, tmp_path, name, content, said):
    for path in (away / "two").iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / name).write_text(content)
    with pytest.raises(BadInput, match=said):
        read_reported(tmp_path, "x")


def test_what_no_record_shows_is_said_once_with_what_it_would_do_to_k(two, away):
    page = plain(page_of(two))
    assert page.count("<h3>Not checked</h3>") == 1
    assert page.count("A force that is 1 % too large makes k, C and J 1 % too large.") == 1
    assert plain(page_of(two, dataclasses.replace(two, name="again"))).count("<h3>Not checked</h3>") == 1
    run = {**two.run, "options": {"displacement_scale_sd": 0.05}}
    stated = plain(page_of(dataclasses.replace(two, run=run)))
    assert "An error with a standard deviation of 5 % is in the intervals" in stated
    assert "is in the intervals" not in page
    printed = page_of(dataclasses.replace(two, run={**two.run, "origin": "published"}))
    assert "A filter that is longer" in page
    assert "A filter that is longer" not in printed


def test_every_cell_of_a_table_has_its_heading_for_a_narrow_screen(two):
    headings = re.findall(r'<td data-head="([^"]*)"', page_of(two))
    assert {"configuration", "speed km/h", "k kN/mm", "beta mm", "P(> 1), k"} <= set(map(unescape, headings))
