"""Comparison of several results on one page: ratios between independent ones, and none where they are not."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.pages import plain
from helpers.reported_results import write_made

from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.report.answer.load import read_reported
from bayes_tyre.report.html.between_results import ComparedResult, compare_results
from bayes_tyre.report.html.page import Part, document


def side(folder: Path) -> ComparedResult:
    result = read_reported(folder, folder.name)
    return ComparedResult(folder.name, read_tree(folder / "posterior.nc"), result.run)


def of_run(result: ComparedResult, **changes: object) -> ComparedResult:
    return result._replace(run={**result.run, **changes})


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
    assert "averaged over the cases of both: median and 95" in page
    named = re.findall(r' id="([^"]+)"', page)
    assert len(set(named)) == len(named) > 5


def test_a_single_tyre_is_compared_with_a_dual_pair_of_another_folder(away):
    folders = [write_made(away / name, {name: k}, seed=i) for i, (name, k) in enumerate([("lone", 1.5), ("pair", 2.0)])]
    ratio = compare_results(side(folders[0]), side(folders[1]), 0.95).ratios["k"][0]
    assert (ratio.above, ratio.below) == ("lone (lone)", "pair (pair)")
    assert ratio.median == pytest.approx(0.75, rel=0.01)


def test_what_is_not_independent_is_not_compared(two, away):
    one = side(away / "two")
    assert "fits of the same records" in compare_results(one, one._replace(name="again"), 0.95).limitation
    printed = of_run(one, inputs={"table.csv": "x"}, origin="published")
    found = compare_results(of_run(one, origin="reconstructed"), printed, 0.95)
    assert not found.ratios
    assert "rest on the same printed tables" in found.limitation


def test_results_that_share_a_column_map_are_compared(two, away):
    one = of_run(side(away / "two"), inputs={"mine.csv": "a", "map.toml": "m"}, options={"columns": {}})
    later = side(write_made(away / "with_the_same_map", {"single": 1.65, "dual": 2.0}, seed=9))
    other = of_run(later, inputs={"theirs.csv": "b", "map.toml": "m"}, options={"columns": {}})
    assert compare_results(one, other, 0.95).ratios["k"]


def test_intervals_of_results_are_told_apart_where_they_differ(two):
    other = replace(two, name="other", cases=two.cases.assign(interval=0.8))
    page = plain(document([Part(two, []), Part(other, [])]))
    assert "Median and 95 % interval of two, 80 % interval of other." in page
    assert "Median and 95 % interval. " in plain(document([Part(two, [])]))
