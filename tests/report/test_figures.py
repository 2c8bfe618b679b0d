"""Every figure of a result, from its posterior to the page."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from drawings import said, sticking_out
from hand_made_posteriors import posterior, scattered
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from simulated_records import Plan, simulate

from bayes_tyre.record_table import record_words
from bayes_tyre.report import colours, figures, summary
from bayes_tyre.report.figures import ALWAYS, OF_RECORDS, Result

PLANS = {
    "one case": Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=40),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=40),
    "five configurations": Plan(configurations=tuple("abcde"), speeds=(0.0,), loads=(20.0,), repeats=2, points=30),
    "hostile labels": Plan(configurations=("x" * 200, "$\\frac{", "_<b>"), speeds=(0.0,), loads=(20.0,), points=30),
}


def result(table: pd.DataFrame | None, tree: xr.DataTree, verdict: str = "pass") -> Result:
    tables = summary.cases(tree, verdict), summary.repeats(tree, verdict)
    return Result(tree, verdict, *tables, table, None, 0.95)


def of_records(plan: Plan, columns: list[str] | None = None) -> Result:
    table, _ = simulate(plan, 1)
    table = table[columns] if columns else table
    words = record_words(table)
    return result(table, posterior(scattered(words, seed=1), words), "fail")


@pytest.fixture(scope="module", params=PLANS)
def every(request) -> dict[str, Figure]:
    return dict(figures.draw(of_records(PLANS[request.param])))


def test_a_result_of_records_has_ten_figures_that_say_origin_and_verdict_and_keep_within_the_page(every):
    assert list(every) == [*ALWAYS, *OF_RECORDS]
    assert len(set(every)) == 10
    for name, figure in every.items():
        texts = said(figure)
        assert "data: simulated, not measured" in texts, name
        assert "verdict: fail, not to be trusted" in texts, name
        assert not sticking_out(figure), name


def test_a_configuration_has_one_colour_in_all_figures_of_a_result(every):
    look = colours.looks("abcde")
    for name, figure in every.items():
        texts = [text.get_text() for box in figure.legends for text in box.get_texts()]
        handles = [handle for box in figure.legends for handle in box.legend_handles]
        for text, handle in zip(texts, handles, strict=True):
            label = text.split(", ")[-1]
            if label in look:
                assert isinstance(handle, Patch | Line2D)
                colour = handle.get_facecolor()[:3] if isinstance(handle, Patch) else handle.get_color()
                assert to_hex(colour) == look[label].colour.lower(), name


def test_records_without_a_word_have_all_figures_too():
    made = of_records(PLANS["one case"], ["record", "displacement_mm", "force_kN"])
    assert [name for name, _ in figures.draw(made)] == [*ALWAYS, *OF_RECORDS]


def test_printed_cases_have_the_figures_that_need_no_record():
    words = record_words(simulate(PLANS["one case"], 1)[0])
    cases = words.drop(columns=["record", "repeat"]).drop_duplicates().reset_index(drop=True)
    of_cases = {n: d for n, d in scattered(words, seed=2).items() if n.endswith(("_case", "_cell", "_scale"))}
    drawn = dict(figures.draw(result(None, posterior(of_cases, cases, origin="published"))))
    assert list(drawn) == list(ALWAYS)
    assert any("value to expect" in text for text in said(drawn["forest_of_cases"]))


def test_bands_under_a_factor_on_displacement_are_those_of_the_measured_one():
    table, _ = simulate(PLANS["one case"], 1)
    words = record_words(table)
    draws = scattered(words, seed=3)
    factor = 1 + 0.05 * np.random.default_rng(4).normal(size=draws["k"].shape[:2])
    scaled = draws | {"k": draws["k"] / factor[..., None], "beta": draws["beta"] * factor[..., None]}
    tree = posterior(scaled, words)
    dataset = tree["posterior"].to_dataset().assign(displacement_scale=(("chain", "draw"), factor))
    tree["posterior"] = xr.DataTree(dataset)
    lines = []
    for made in (result(table, posterior(draws, words)), result(table, tree)):
        figure = OF_RECORDS["records_with_bands"](made, table)
        lines.append([np.asarray(line.get_ydata()) for ax in figure.get_axes() for line in ax.lines])
    for one, other in zip(*lines, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
