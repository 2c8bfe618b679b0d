"""The page itself, without a browser: labels are text, nothing is loaded from outside, the same bytes each time."""

import dataclasses
import html
import re
from html import unescape

import pytest
from helpers.pages import page_of, plain
from helpers.reported_results import SCRIPT

from bayes_tyre.errors import BadInput
from bayes_tyre.report.answer.load import read_reported


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


def test_options_stand_as_a_reader_knows_them_and_not_as_python_has_them(two):
    options = {"limit": None, "units_checked": True, "columns": {"columns": {"force_kN": {"unit": "N"}}}}
    page = html.unescape(page_of(dataclasses.replace(two, run={**two.run, "options": options})))
    assert 'units_checked yes, columns {"columns": {"force_kN": {"unit": "N"}}}' in page
    assert "limit None" not in page


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
    assert "With a filter longer than the response" in page
    assert "With a filter longer than the response" not in printed
