"""The report's page of what `motion` wrote: k, friction and energy in the answer, its tables, two side by side."""

import dataclasses
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from helpers.quick_motions import TYPICAL
from helpers.reported_motions import write_motions

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.report.answer.caveats import caveats
from bayes_tyre.report.answer.headline import headline
from bayes_tyre.report.answer.load import Reported, read_reported
from bayes_tyre.report.figures.catalogue import ALWAYS, OF_MOTIONS
from bayes_tyre.report.html import tables
from bayes_tyre.report.html.between_results import ComparedResult, compare_results
from bayes_tyre.report.html.figures import HEADINGS
from bayes_tyre.report.html.page import Part, document
from bayes_tyre.results.comparison.law_weights import Evidence, laws_table

COLUMNS = ["k", "x", "beta", "m", "c", "energy a cycle"]


@pytest.fixture(scope="module")
def away(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("motions")


@pytest.fixture(scope="module")
def both(away) -> Reported:
    return read_reported(write_motions(away / "both"), "both")


@pytest.fixture(scope="module")
def one(away) -> Reported:
    return read_reported(write_motions(away / "one", ("single",)), "one")


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def page_of(*results: Reported) -> str:
    return plain(unescape(document([Part(result, []) for result in results])))


def test_the_answer_says_stiffness_friction_and_energy(one, both):
    first, second = map(plain, headline(one))
    assert re.match(r"The stiffness k is 1\.\d+ kN/mm for single in loading \(95 % interval", first)
    friction = re.search(r"^Friction x is (\S+) kN for single in loading \(95 % interval (\S+) to (\S+)\)", second)
    assert friction
    x, lower, upper = map(float, friction.groups())
    assert x == pytest.approx(TYPICAL[1] + TYPICAL[0] * TYPICAL[2], rel=0.01)
    assert lower < x < upper
    assert re.search(r"; a cycle of 2 mm amplitude at the wheel centre loses \d\.\d+ J for single in loading", second)
    several = plain(headline(both)[1])
    assert several.count(" J for ") == 4
    assert several.endswith("(medians; their intervals stand in the table below).")


def test_the_answer_without_an_amplitude_claims_none(one):
    run = {**one.run, "options": {}}
    second = headline(Reported(**{**vars(one), "run": run}))[1]
    assert "a cycle of unknown amplitude" in second


def test_tables_have_every_parameter_of_motions(both):
    for table in (tables.cases_table([both]), tables.repeats_table([both]), tables.means_table([both])):
        assert [column.heading for column in table.columns][-6:] == COLUMNS
        assert all(cell.text for row in table.rows for cell in row[-6:])
    contrasts = [column.heading for column in tables.contrasts_table([both]).columns]
    assert [name for name in contrasts if name.startswith("ratio")] == [f"ratio of {name}" for name in COLUMNS]
    losses = tables.losses_table([both])
    assert [(column.heading, column.unit) for column in losses.columns][-6:] == [
        *(("loss factor", ""), ("equivalent damping", "kN s/mm"), ("separation of branches", "kN")),
        *(("stiffness of a slow cycle", "kN/mm"), ("stiffness of a cycle at 1 Hz", "kN/mm")),
        ("stiffness of free vibration", "kN/mm"),
    ]
    assert len(losses.rows) == len(both.cases[both.cases["parameter"] == "k"])


def test_weights_of_force_laws_are_a_table_of_results_that_have_them(away, one, both):
    logs = np.array([[0.0, 8.0], [0.0, 9.0], [0.0, 12.0]])
    own = np.array([[0.25, 0.75]] * 3)
    written = laws_table(
        Evidence(("fancher", "relaxing"), logs, np.isfinite(logs), own, np.repeat("dual", 3)), "simulated"
    )
    written.to_csv(away / "both" / "laws.csv", index=False)
    averaged = read_reported(away / "both", "averaged")
    (away / "both" / "laws.csv").unlink()
    table = tables.laws_table([averaged])
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["dual", "relaxing", ">= 0.9999", "0.750", "3", "0", "0", "3"],
        ["dual", "fancher", "<= 0.0001", "0.250", "0", "\N{MINUS SIGN}29.00", "3.606", "3"],
    ]
    assert "how far the records of each configuration prefer them" in page_of(averaged)
    assert "Force laws:" not in page_of(both)
    beside = tables.laws_table([averaged, one])
    assert {column.of_result for column in beside.columns[2:]} == {"averaged"}
    assert "Force laws:" in page_of(averaged, one)


def test_a_table_of_laws_that_motion_did_not_write_is_refused(away, both):
    (away / "both" / "laws.csv").write_text("law,weight\nfancher,1\n")
    with pytest.raises(BadInput, match="no column weight_by_record; run motion again"):
        read_reported(away / "both", "both")
    (away / "both" / "laws.csv").unlink()


def test_the_page_names_what_it_is_of_and_what_not_to_believe(both):
    page = page_of(both)
    assert "<h1>Tyre stiffness, friction and energy lost: dual, single</h1>" in page
    assert "Simulated: records computed from a model." in page
    assert "Loss factor" in page
    assert "energy_per_cycle" not in page
    said = list(map(plain, caveats(both)))
    assert any("2 mm amplitude" in one and "another stroke" in one for one in said)
    tests = next(one for one in said if "slow test" in one)
    assert re.search(r"\d kN/mm for a slow cycle of 2.mm amplitude .*\d kN/mm for a free vibration of 0\.1.mm", tests)


def test_energy_is_said_to_be_by_friction_only_where_the_law_has_some(both):
    friction = both.summary["parameter"].isin(["x_mean", "settled_mean"])
    without = dataclasses.replace(both, summary=both.summary[~friction])
    of_friction, of_dampers = (" ".join(map(plain, caveats(result))) for result in (both, without))
    assert "the viscous damping c is not in it" in of_friction
    assert "the viscous damping c is not in it" not in of_dampers
    assert "its dampers lose all of it, c among them" in of_dampers


def side(folder: Path) -> ComparedResult:
    return ComparedResult(folder.name, read_tree(folder / "posterior.nc"), read_reported(folder, folder.name).run)


def test_two_results_are_compared_in_every_parameter_and_in_energy_at_one_stroke_only(away, both, one):
    del both, one
    found = compare_results(side(away / "both"), side(away / "one"), 0.95)
    assert list(found.ratios) == ["k", "x", "beta", "m", "c", "energy_per_cycle"]
    assert [ratio.above for ratio in found.ratios["x"]] == ["single (both)"]
    # The same seed draws both, two configurations in one and one in the other: 3 % a case.
    assert found.ratios["x"][0].median == pytest.approx(1.0, abs=0.02)
    other = side(away / "one")
    assert other.tree is not None
    other.tree.attrs["amplitude_mm"] = 1.0
    assert list(compare_results(side(away / "both"), other, 0.95).ratios) == ["k", "x", "beta", "m", "c"]


def test_figures_of_motions_have_words_of_their_own():
    assert {*ALWAYS, *OF_MOTIONS, "loops_by_direction"} <= set(HEADINGS)
