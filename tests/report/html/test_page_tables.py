"""Tables of the page: every row once, a column a parameter, results side by side."""

import dataclasses
import re
from html import unescape

import numpy as np
import pandas as pd
from helpers.pages import page_of
from helpers.reported_results import made

from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.html import tables


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


def test_every_cell_of_a_table_has_its_heading_for_a_narrow_screen(two):
    headings = re.findall(r'<td data-head="([^"]*)"', page_of(two))
    assert {"configuration", "speed km/h", "k kN/mm", "beta mm", "P(> 1), k"} <= set(map(unescape, headings))
