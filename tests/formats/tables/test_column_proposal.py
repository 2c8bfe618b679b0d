"""Proposed column maps: what is placed, what is left to the user, and that a map so made reads the file."""

import tomllib
from pathlib import Path

import pandas as pd
import pytest

from bayes_tyre.formats.tables.column_map import ColumnMap
from bayes_tyre.formats.tables.column_proposal import Proposal, layout_by_vocabulary, propose
from bayes_tyre.formats.tables.table_files import read_table


def proposed(path: Path, text: str) -> tuple[Proposal, ColumnMap]:
    path.write_text(text, encoding="utf-8")
    proposal = propose(read_table(path, layout_by_vocabulary()))
    return proposal, ColumnMap.model_validate(tomllib.loads(proposal.toml))


GERMAN = """Prüfstand 3;Halle 2
Versuch;Reifen;Lastrichtung;Geschwindigkeit (km/h);Last in kN;Weg [mm];Kraft [N];Zeit_ms;Stufe;Wdh.;Druck [bar]
1;A;auf;0;10;0,1;2000,5;1;10;1;8
2;A;Entlastung;0;20;0,1;-200,5;1;-10;1;8
"""


def test_german_names_units_and_directions_are_placed_and_the_map_reads_the_file(tmp_path):
    proposal, column_map = proposed(tmp_path / "a.csv", GERMAN)
    assert tomllib.loads(proposal.toml) == {
        "columns": {
            **{"record": "Versuch", "configuration": "Reifen", "direction": "Lastrichtung"},
            **{"speed_km_h": "Geschwindigkeit (km/h)", "initial_load_kN": "Last in kN", "displacement_mm": "Weg [mm]"},
            **{"force_kN": {"name": "Kraft [N]", "unit": "N"}, "time_s": {"name": "Zeit_ms", "unit": "ms"}},
            **{"step_kN": "Stufe", "repeat": "Wdh."},
        },
        "values": {"direction": {"auf": "loading", "Entlastung": "unloading"}},
    }
    assert proposal.unplaced == ["column 'Druck [bar]': stays as a further column"]
    assert proposal.toml.startswith("# not placed: column 'Druck [bar]': stays as a further column\n[columns]\n")
    assert proposal.command == "lsq"
    table = column_map.applied(read_table(tmp_path / "a.csv", column_map.layout), tmp_path / "a.csv")
    assert table[["record", "direction", "force_kN", "time_s"]].to_dict("list") == {
        **{"record": ["1", "2"], "direction": ["loading", "unloading"]},
        **{"force_kN": [2.0005, -0.2005], "time_s": [0.001, 0.001]},
    }


def test_a_table_with_our_names_needs_no_map(tmp_path):
    names = "record,displacement_mm,force_kN,direction,initial_load_kN,origin"
    proposal, column_map = proposed(tmp_path / "a.csv", f"{names}\na,1,2,loading,30,measured\n")
    assert proposal == ("[columns]\n", [], [], "lsq", True)
    assert column_map == ColumnMap()


def test_a_map_of_a_table_without_an_origin_ends_with_how_to_state_it(tmp_path):
    names = "record,displacement_mm,force_kN,direction,initial_load_kN"
    proposal, column_map = proposed(tmp_path / "a.csv", f"{names}\na,1,2,loading,30\n")
    assert (column_map, proposal.states_origin) == (ColumnMap(), False)
    stated = proposal.toml.replace("\n#[", "\n[").replace("\n#origin", "\norigin")
    assert tomllib.loads(stated) == {"columns": {}, "constants": {"origin": "measured"}}


def test_a_row_of_units_is_left_to_the_reader(tmp_path):
    proposal, _ = proposed(tmp_path / "a.csv", "Test,Displacement,Force\n-,m,N\na,1,2\n")
    columns = {"record": "Test", "displacement_mm": "Displacement", "force_kN": "Force"}
    assert tomllib.loads(proposal.toml) == {"columns": columns}


@pytest.mark.parametrize(
    ("text", "columns", "unplaced"),
    [
        ("Versuch,S1 [mm],S2 [N]\na,1,2\n", {"record", "displacement_mm", "force_kN"}, []),
        (
            "Versuch,S1 [mm],S2 [mm],F\na,1,2,3\n",
            {"record"},
            [
                *(f"column {name}: stays as a further column" for name in ("'S1 [mm]'", "'S2 [mm]'", "'F'")),
                *(f"{name}: required, and no column found for it" for name in ("displacement_mm", "force_kN")),
            ],
        ),
        (
            "Versuch,Weg,Einfederung,Kraft\na,1,2,3\n",
            {"record", "force_kN"},
            [
                *(
                    f"column {n}: displacement_mm, as 2 columns could be; choose one"
                    for n in ("'Weg'", "'Einfederung'")
                ),
                "displacement_mm: required, and no column found for it",
            ],
        ),
        (
            "Versuch,Weg,Kraft [V]\na,1,2\n",
            {"record", "displacement_mm"},
            [
                "column 'Kraft [V]': force_kN, but not in kN, N, lbf; convert it first",
                "force_kN: required, and no column found for it",
            ],
        ),
        (
            "Versuch,Weg,Kraft,Richtung\na,1,2,halten\n",
            {"record", "displacement_mm", "force_kN", "direction"},
            [
                "direction 'halten': loading or unloading? say so in [values.direction]",
                "initial_load_kN: no column found for it; loading and unloading are not compared without: add one to "
                "the table, or put it under [constants] where all records start from one load",
            ],
        ),
    ],
)
def test_what_is_not_clear_is_left_to_the_user_and_said(text, columns, unplaced, tmp_path):
    proposal, column_map = proposed(tmp_path / "a.csv", text)
    assert column_map.columns.keys() == columns
    assert proposal.unplaced == unplaced
    comments = [line.removeprefix("# not placed: ") for line in proposal.toml.splitlines() if "# not" in line]
    assert comments == unplaced


def test_a_column_is_one_of_directions_by_its_values(tmp_path):
    proposal, _ = proposed(tmp_path / "a.csv", "Versuch,Weg,Kraft,Art\na,1,2,Belastung\n")
    assert tomllib.loads(proposal.toml)["columns"]["direction"] == "Art"


@pytest.mark.parametrize(
    ("steps", "expected"),
    [((5, 10), {"name": "Stufe", "unsigned": True}), ((5, -10), "Stufe"), ((5, ""), "Stufe")],
)
def test_steps_are_unsigned_where_none_falls_though_a_load_does(steps, expected, tmp_path):
    rows = f"a,1,2,Belastung,{steps[0]}\nb,1,2,Entlastung,{steps[1]}\n"
    proposal, _ = proposed(tmp_path / "a.csv", f"Versuch,Weg,Kraft,Art,Stufe\n{rows}")
    assert tomllib.loads(proposal.toml)["columns"]["step_kN"] == expected
    upward = rows.replace("Entlastung", "Belastung")
    proposal, _ = proposed(tmp_path / "b.csv", f"Versuch,Weg,Kraft,Art,Stufe\n{upward}")
    assert tomllib.loads(proposal.toml)["columns"]["step_kN"] == "Stufe"


@pytest.mark.parametrize(("loads", "command"), [((10, 10), "lsq"), ((10, 20), "load-deflection")])
def test_a_load_that_varies_in_a_test_without_a_force_is_of_a_slow_test(loads, command, tmp_path):
    text = f"Versuch,Weg,Last\na,1,{loads[0]}\na,2,{loads[1]}\n"
    proposal, column_map = proposed(tmp_path / "a.csv", text)
    assert proposal.command == command
    slow = {"test", "displacement_mm", "load_kN"}
    assert column_map.columns.keys() == (
        slow if loads[1] > loads[0] else {"record", "displacement_mm", "initial_load_kN"}
    )


def test_names_with_line_breaks_stay_in_one_comment(tmp_path):
    table = pd.DataFrame({"Versuch": ["a"], "two\nlines": [1.0]})
    proposal = propose(table)
    assert tomllib.loads(proposal.toml) == {"columns": {"record": "Versuch"}}


@pytest.mark.parametrize(("force", "name"), [("Kraft", "record"), ("Prüflast", "test")])
def test_a_file_without_a_name_may_be_one_record_or_test(force, name, tmp_path):
    proposal, _ = proposed(tmp_path / "a.csv", f"Weg;{force}\n0;1\n1;2\n")
    remedy = f'if the whole file is one {name}, write {name} = "NAME" under [constants]'
    assert proposal.unplaced == [f"{name}: required, and no column found for it; {remedy}"]
