"""Every figure of a result, from its posterior to the page."""

import dataclasses
from collections.abc import Iterable

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.drawings import said, sticking_out
from helpers.hand_made_posteriors import posterior, scattered
from helpers.simulated_records import Plan, simulate
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.record_table import record_factors
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import ALWAYS, CONTRASTS, OF_RECORDS, OUTLIERS, Result, chosen_figure
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.workflow import result_folder as folder
from bayes_tyre.workflow.drawing import drawing_process
from bayes_tyre.workflow.execution.resume import Callbacks

PLANS = {
    "one case": Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=40),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=40),
    "five configurations": Plan(configurations=tuple("abcde"), speeds=(0.0,), loads=(20.0,), repeats=2, points=30),
    "hostile labels": Plan(configurations=("x" * 200, "$\\frac{", "_<b>"), speeds=(0.0,), loads=(20.0,), points=30),
}


def result(table: pd.DataFrame | None, tree: xr.DataTree, verdict: str = "pass") -> Result:
    return Result(tree, verdict, table)


def of_records(plan: Plan, columns: list[str] | None = None) -> Result:
    table, _ = simulate(plan, 1)
    table = table[columns] if columns else table
    factor_table = record_factors(table)
    return result(table, posterior(scattered(factor_table, seed=1), factor_table), "fail")


def but_ratios(names: Iterable[str]) -> list[str]:
    """Return names of figures but those that not every result has: ratios, odd repeats."""
    return [name for name in names if name not in (CONTRASTS, OUTLIERS)]


@pytest.fixture(scope="module", params=PLANS)
def every(request) -> dict[str, Figure]:
    return dict(catalogue.draw(of_records(PLANS[request.param])))


def test_figures_of_a_result_of_records_say_origin_and_verdict_and_keep_within_the_page(every):
    assert but_ratios(every) == but_ratios([*ALWAYS, *OF_RECORDS])
    for name, figure in every.items():
        texts = said(figure)
        assert "data: simulated, not measured" in texts, name
        assert "verdict: fail, not to be trusted" in texts, name
        assert not sticking_out(figure), name


def test_a_configuration_has_one_colour_in_all_figures_of_a_result(every):
    look = Setting("measured").looks("abcde")
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
    drawn = [name for name, _ in catalogue.draw(made)]
    assert but_ratios(drawn) == but_ratios([*ALWAYS, *OF_RECORDS])
    assert drawn[-1] == OUTLIERS


def test_ratios_are_drawn_where_cases_match_and_nowhere_else():
    two = dataclasses.replace(PLANS["one record"], configurations=("a", "b"))
    matched, alone = of_records(two), of_records(PLANS["one record"])
    assert len(matched.contrasts) > 0
    assert CONTRASTS in dict(catalogue.draw(dataclasses.replace(matched, table=None)))
    assert len(alone.contrasts) == 0
    assert CONTRASTS not in dict(catalogue.draw(dataclasses.replace(alone, table=None)))


def test_odd_repeats_are_drawn_where_the_model_judges_any_and_nowhere_else(tmp_path, monkeypatch):
    made = of_records(PLANS["one case"])
    alone = of_records(PLANS["one record"])  # one repeat of a case has nothing to be judged by
    posterior = made.tree["posterior"].to_dataset().drop_vars("outlier_probability")
    normal = result(made.table, xr.DataTree.from_dict({"posterior": posterior}, name=made.tree.name))
    normal.tree.attrs |= made.tree.attrs
    assert [each.judges for each in (made, alone, normal)] == [True, False, False]
    with pytest.raises(BadInput, match=f"{OUTLIERS}: this posterior judges no record"):
        chosen_figure(normal, OUTLIERS)
    assert chosen_figure(made, OUTLIERS).axes
    monkeypatch.setattr(catalogue, "drawings", lambda of, _: iter([(OUTLIERS, Figure)] if of.judges else []))
    for each, there in ((made, True), (normal, False)):  # what the first has left the second takes away
        with drawing_process(apart=False) as begin:
            folder._write_figures(each, tmp_path, Attempts(), begin, Callbacks())
        assert (tmp_path / f"{OUTLIERS}.png").exists() == there


def test_printed_cases_have_the_figures_that_need_no_record():
    factor_table = record_factors(simulate(PLANS["one case"], 1)[0])
    cases = factor_table.drop(columns=["record", "repeat"]).drop_duplicates().reset_index(drop=True)
    of_cases = {n: d for n, d in scattered(factor_table, seed=2).items() if n.endswith(("_case", "_group", "_scale"))}
    drawn = dict(catalogue.draw(result(None, posterior(of_cases, cases, origin="published"))))
    assert but_ratios(drawn) == but_ratios(ALWAYS)
    assert any("of the expected value" in text for text in said(drawn["forest_of_cases"]))


def test_bands_under_a_factor_on_displacement_are_those_of_the_measured_one():
    table, _ = simulate(PLANS["one case"], 1)
    factor_table = record_factors(table)
    draws = scattered(factor_table, seed=3)
    factor = 1 + 0.05 * np.random.default_rng(4).normal(size=draws["k"].shape[:2])
    scaled = draws | {"k": draws["k"] / factor[..., None], "beta": draws["beta"] * factor[..., None]}
    tree = posterior(scaled, factor_table)
    dataset = tree["posterior"].to_dataset().assign(displacement_scale=(("chain", "draw"), factor))
    tree["posterior"] = xr.DataTree(dataset)
    lines = []
    for made in (result(table, posterior(draws, factor_table)), result(table, tree)):
        figure = OF_RECORDS["records_with_bands"](made, table)()
        lines.append([np.asarray(line.get_ydata()) for ax in figure.get_axes() for line in ax.lines])
    for one, other in zip(*lines, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
