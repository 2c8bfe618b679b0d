"""Text for vehicle simulators, read back by readers that are not ours."""

import configparser
import io
import re

import numpy as np
import pandas as pd

from bayes_tyre.formats.simulator import combi_table, modelica_record, property_file, spline_file

ROWS = [(0.0, 0.0), (0.00125, 2094.841253364672), (0.1 + 0.2, -1e-07)]
ABOUT = ["two\nlines = [none]", "ü " * 60]


def test_a_property_file_is_an_ini_with_numbers_unrounded():
    sections = {"UNITS": {"LENGTH": "meter"}, "MODEL": {}, "VERTICAL": {"VERTICAL_STIFFNESS": 1500026.3530045927}}
    text = property_file(sections, ABOUT, {"CURVE": ("pen fz", ROWS)})
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 80
    ini = configparser.ConfigParser(comment_prefixes="$", allow_no_value=True, delimiters="=")
    ini.read_string(text)
    assert ini.sections() == ["UNITS", "MODEL", "VERTICAL", "CURVE"]
    assert ini["UNITS"]["LENGTH"] == "'meter'"
    assert float(ini["VERTICAL"]["VERTICAL_STIFFNESS"]) == 1500026.3530045927
    columns, *rows = ini["CURVE"]
    assert columns == "{pen fz}"
    assert [tuple(map(float, row.split())) for row in rows] == ROWS


def test_a_spline_is_a_csv_below_comments():
    assert np.loadtxt(io.StringIO(spline_file(ROWS, ABOUT)), delimiter=",").tolist() == [list(row) for row in ROWS]


def test_a_combi_table_begins_with_its_mark_and_announces_its_size():
    text = combi_table("force", ROWS, ABOUT)
    head, _, numbers = text.partition("double force(3,2)\n")
    assert head.startswith("#1\n")
    assert all(line.startswith("#") for line in head.splitlines())
    assert list(pd.read_csv(io.StringIO(numbers), sep=" ", header=None).itertuples(index=False, name=None)) == ROWS


def test_a_modelica_record_has_a_parameter_with_its_unit_in_each_line():
    text = modelica_record("a_1", {"k": (1.5e6, "N/m", "from 1 to 2"), "beta": (8e-05, "m", "")}, ABOUT)
    lines = text.splitlines()
    assert (lines[0], lines[-1]) == ("record a_1", "end a_1;")
    code = [line for line in lines[1:-1] if not line.startswith("  // ")]
    pattern = r'  parameter Real (\w+)\(unit="(.*)"\) = (\S+) "(.*)";'
    parsed = [one.groups() for line in code if (one := re.fullmatch(pattern, line))]
    assert parsed == [("k", "N/m", "1500000.0", "from 1 to 2"), ("beta", "m", "8e-05", "")]
