"""`columns` and `--columns` as a user meets them: a lab's file in, its map proposed, the same numbers out."""

import json
import tomllib
from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, small, tree_of, written
from helpers.quick_fits import put_draws_for_the_sampler
from scipy.io import savemat

from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.report.figures import catalogue
from bayes_tyre.workflow import fit as workflow
from bayes_tyre.workflow.record_tables import read_given

# Compilation: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

PREAMBLE = [["Prüfstand", "Müller, Halle 2"], ["Datum", "24.11.2026"], []]
#: Their name of each column of the small table; force in N, displacement in m.
NAMES = {
    **{"record": "Versuch", "configuration": "Reifengröße", "direction": "Richtung", "speed_km_h": "Geschwindigkeit"},
    **{"initial_load_kN": "Last", "step_kN": "Stufe", "repeat": "Wiederholung"},
    **{"displacement_mm": "Weg", "force_kN": "Kraft"},
}
UNITS = {"Weg": "m", "Kraft": "N", "Last": "kN", "Stufe": "kN", "Geschwindigkeit": "km/h"}
MAP = """
[columns]
record = "Versuch"
configuration = "Reifengröße"
direction = "Richtung"
speed_km_h = "Geschwindigkeit"
initial_load_kN = "Last"
step_kN = "Stufe"
repeat = "Wiederholung"
displacement_mm = { name = "Weg", unit = "m" }
force_kN = { name = "Kraft", unit = "N" }
[values.direction]
Belastung = "loading"
Entlastung = "unloading"
"""


def theirs() -> pd.DataFrame:
    table = small().rename(columns=NAMES)
    table["Richtung"] = table["Richtung"].map({"loading": "Belastung", "unloading": "Entlastung"})
    return table.assign(Weg=table["Weg"] / 1000, Kraft=table["Kraft"] * 1000)


def as_csv(encoding: str):
    """Return what writes their table with a preamble, a row of units, semicolons and decimal commas."""

    def write(folder: Path) -> Path:
        header = [str(name) for name in theirs()]
        rows = [";".join(row) for row in [*PREAMBLE, header, [UNITS.get(name, "") for name in header]]]
        cells = theirs().to_csv(index=False, header=False, sep=";", decimal=",", lineterminator="\r\n")
        (folder / "lab.csv").write_bytes(("\r\n".join(rows) + "\r\n" + cells).encode(encoding))
        return folder / "lab.csv"

    return write


def as_sheet(folder: Path) -> Path:
    book = openpyxl.Workbook()
    sheet = book.create_sheet("Messung")
    for row in [*PREAMBLE, list(theirs()), *theirs().to_numpy().tolist()]:
        sheet.append(row)
    book.save(folder / "lab.xlsx")
    return folder / "lab.xlsx#Messung"


def as_parquet(folder: Path) -> Path:
    theirs().to_parquet(folder / "lab.parquet")
    return folder / "lab.parquet"


def as_mat(folder: Path) -> Path:
    table = theirs().rename(columns={"Reifengröße": "Reifen"})
    columns = {name: table[name].to_numpy(object if table[name].dtype == "str" else float) for name in table}
    savemat(folder / "lab.mat", {"daten": columns})
    return folder / "lab.mat"


def fits(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "least_squares.csv")


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> pd.DataFrame:
    """Return what `lsq` writes of the table with our names and units."""
    folder = tmp_path_factory.mktemp("ours")
    assert here("lsq", written(small(), folder / "records.csv"), "--out", folder).exit_code == 0
    return fits(folder)


@pytest.mark.parametrize("write", [as_csv("utf-16"), as_csv("cp1252"), as_sheet, as_parquet, as_mat])
def test_a_lab_s_file_and_its_map_give_the_same_fits(write, expected, tmp_path):
    path = write(tmp_path)
    text = MAP.replace("Reifengröße", "Reifen") if write is as_mat else MAP
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    done = here("lsq", path, "--columns", tmp_path / "map.toml", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.stderr
    # 1e-6 of the standard errors would do; units cost a last digit or two.
    pd.testing.assert_frame_equal(fits(tmp_path / "out"), expected, rtol=1e-6)


@pytest.mark.parametrize("write", [as_csv("cp1252"), as_csv("utf-8-sig")])
def test_the_proposed_map_reads_the_file_and_units_are_said(write, expected, tmp_path):
    path = write(tmp_path)
    done = here("columns", path, "--out", tmp_path / "map.toml")
    assert done.exit_code == 0
    left = "column 'Reifengröße': stays as a further column"
    assert f"bayes-tyre: warning: {path}: {left}\n" in done.stderr
    assert f"next: bayes-tyre lsq {path} --columns {tmp_path / 'map.toml'} --out results/lsq" in done.stdout
    shown = here("columns", path)
    assert shown.stdout == (tmp_path / "map.toml").read_text(encoding="utf-8")
    assert f"# not placed: {left}\n" in shown.stdout
    columns = tomllib.loads(shown.stdout)["columns"]
    assert columns == {ours: name for ours, name in NAMES.items() if ours != "configuration"}
    done = here("lsq", path, "--columns", tmp_path / "map.toml", "--out", tmp_path / "out")
    for what in ("column 'Weg' is in m by its row of units: converted to mm", "'Kraft' is in N"):
        assert what in done.stderr
    numbers = ["record", "k_kN_per_mm", "beta_mm"]
    pd.testing.assert_frame_equal(fits(tmp_path / "out")[numbers], expected[numbers], rtol=1e-6)


def test_a_map_or_a_file_that_does_not_fit_is_refused_and_nothing_is_written(tmp_path):
    path = as_csv("cp1252")(tmp_path)
    (tmp_path / "map.toml").write_text(MAP.replace('"Weg"', '"Hub"'), encoding="utf-8")
    (tmp_path / "bad.toml").write_text('[columns]\nkraft = "Kraft"\n', encoding="utf-8")
    before = tree_of(tmp_path)
    for command in ("lsq", "fit", "load-deflection"):
        for name, said in (("map.toml", "no column 'Hub'"), ("bad.toml", "columns.kraft"), ("none.toml", "none.toml")):
            done = here(command, path, "--columns", tmp_path / name, "--out", tmp_path / "out")
            assert_refused(done.exit_code, done.stderr, said)
    assert tree_of(tmp_path) == before


def test_fit_records_the_map_and_its_run_is_repeated_with_it(monkeypatch, tmp_path):
    put_draws_for_the_sampler(monkeypatch)
    monkeypatch.setattr(workflow, "judge", lambda tree, *_: (tree, diagnose(tree)))
    monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
    monkeypatch.chdir(tmp_path)
    first = theirs()["Versuch"].isin(theirs()["Versuch"].unique()[:3])
    Path("lab").mkdir()
    for name, rows in (("a.csv", first), ("b.csv", ~first)):
        written(theirs()[rows], Path("lab") / name)
    Path("map.toml").write_text(MAP, encoding="utf-8")
    done = here("fit", "lab", "--columns", "map.toml", "--out", "one", "--quiet")
    assert done.exit_code == 0, done.stderr
    run = json.loads(Path("one/run.json").read_text(encoding="utf-8"))
    assert list(run["inputs"]) == ["lab/a.csv", "lab/b.csv", "map.toml"]
    assert run["options"]["columns"]["columns"]["force_kN"] == {"name": "Kraft", "unit": "N"}
    plan = workflow.planned_in(Path("one/run.json"), pytest.fail)
    assert plan.columns == Path("map.toml")
    assert plan.options == run["options"]
    assert [str(path) for path in plan.inputs] == list(run["inputs"])
    again = read_given(plan.records, plan.columns).table
    assert again["record"].to_list() == small()["record"].to_list()
    assert again["force_kN"].to_list() == pytest.approx(small()["force_kN"].to_list(), rel=1e-14)
    Path("map.toml").write_text(MAP + "# changed\n", encoding="utf-8")
    done = here("fit", "--from", "one/run.json", "--out", "three", "--quiet")
    assert_refused(done.exit_code, done.stderr, "map.toml: is not the input of one/run.json", "SHA-256 was")


def test_a_map_that_was_edited_is_kept(tmp_path):
    table, out = written(small(), tmp_path / "t.csv"), tmp_path / "map.toml"
    for _ in range(2):  # what is as it was proposed is no loss
        assert here("columns", table, "--out", out).exit_code == 0
    assert not (tmp_path / "map.toml.old").exists()
    out.write_text("# edited by hand\n")
    done = here("columns", table, "--out", out)
    assert done.exit_code == 0
    assert f"{out}: held another map, which is now {out}.old" in done.stderr
    assert (tmp_path / "map.toml.old").read_text() == "# edited by hand\n"


def test_a_table_without_initial_loads_is_told_what_that_costs(tmp_path):
    table = written(small().drop(columns="initial_load_kN"), tmp_path / "t.csv")
    done = here("columns", table)
    assert "initial_load_kN: no column found for it; loading and unloading are not compared without" in done.stderr


def test_a_proposal_that_lacks_a_required_column_asks_for_it_first(tmp_path):
    theirs = small().drop(columns="origin").rename(columns={"force_kN": "Messwert"})
    path = written(theirs, tmp_path / "lab.csv")
    done = here("columns", path, "--out", tmp_path / "map.toml")
    assert f"next: name your columns for force_kN in {tmp_path / 'map.toml'}, then bayes-tyre lsq" in done.stdout
    assert "uncomment the last two lines of the map" in done.stdout
    stated = written(small(), tmp_path / "stated.csv")
    assert "origin" not in here("columns", stated, "--out", tmp_path / "map.toml").stdout
