"""Least squares file by file: the rows of all files together, whoever does the work, and what is said of each file."""

from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import here, small, written

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.record_table import check_record_table
from bayes_tyre.workflow.execution.batch import Machines
from bayes_tyre.workflow.least_squares import FITS
from bayes_tyre.workflow.least_squares_of_files import fit_files, table_tasks
from bayes_tyre.workflow.record_tables import Given, read_given

ALONE = Machines(1)


@pytest.fixture
def halves(tmp_path) -> Path:
    """Return a folder of two files, each with half the records of the small table."""
    table = small()
    first = table["record"].isin(table["record"].unique()[:3])
    folder = tmp_path / "in"
    folder.mkdir()
    written(table[first], folder / "a.csv")
    table[~first].assign(laboratory="north").to_parquet(folder / "b.parquet", index=False)
    return folder


def fitted(path: Path, out: Path, machines: Machines = ALONE) -> Given:
    tasks, skipped = table_tasks([path], None, FitSettings())
    assert skipped == []
    return fit_files(tasks, machines, out, lambda _: None)


def test_the_rows_are_those_of_all_files_fitted_together(halves, tmp_path):
    given = fitted(halves, tmp_path / "out")
    together = fit_records(check_record_table(small()))
    assert list(given.table.columns) == [*together.columns[:-1], "laboratory", "origin"]
    pd.testing.assert_frame_equal(given.table.drop(columns="laboratory"), together, rtol=1e-9)
    assert given.table["laboratory"].isna().tolist() == [True] * 3 + [False] * (len(together) - 3)
    assert (given.suspicions, given.notes) == ([], [])


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(halves, tmp_path):
    for workers in (1, 2):
        command = here("lsq", halves, "--out", tmp_path / str(workers), "--workers", workers, "--xlsx")
        assert command.exit_code == 0, command.stderr
        assert "least_squares.xlsx" in {path.name for path in (tmp_path / str(workers)).iterdir()}
    assert (tmp_path / "1" / FITS).read_bytes() == (tmp_path / "2" / FITS).read_bytes()


def test_what_was_fitted_is_not_fitted_again_and_what_has_changed_is(halves, tmp_path, monkeypatch):
    before = fitted(halves, tmp_path / "out").table
    done = []

    def watched(table: pd.DataFrame, settings: FitSettings) -> pd.DataFrame:
        done.append(table["record"].nunique())
        return fit_records(table, settings)

    monkeypatch.setattr("bayes_tyre.workflow.least_squares_of_files.fit_records", watched)
    again = Machines(1, resume=True)
    pd.testing.assert_frame_equal(fitted(halves, tmp_path / "out", again).table, before)
    assert done == []
    table = pd.read_csv(halves / "a.csv")
    written(table[table["record"] != table["record"].iloc[0]], halves / "a.csv")
    assert len(fitted(halves, tmp_path / "out", again).table) == len(before) - 1
    assert done == [2]


def test_a_table_that_cannot_be_used_is_named_and_nothing_is_written(halves, tmp_path):
    table = pd.read_csv(halves / "a.csv").astype(object)
    table.loc[4, "force_kN"] = "x"
    written(table, halves / "a.csv")
    with pytest.raises(BadInput, match=r"a\.csv: row 5 \(line 6\), record .*, column force_kN"):
        fitted(halves, tmp_path / "out")
    assert not (tmp_path / "out" / FITS).exists()


def test_a_record_in_two_files_is_refused(halves, tmp_path):
    written(small(), halves / "c.csv")
    with pytest.raises(BadInput, match=r"c\.csv: record .* stands in .*a\.csv too; rename one"):
        fitted(halves, tmp_path / "out")


def test_a_column_that_one_of_the_files_lacks_is_refused_as_it_is_of_files_fitted_together(halves, tmp_path):
    written(pd.read_csv(halves / "a.csv").drop(columns="speed_km_h"), halves / "a.csv")
    with pytest.raises(BadInput, match=r"a\.csv: has no column speed_km_h, which .*b\.parquet has") as refused:
        fitted(halves, tmp_path / "out")
    assert not (tmp_path / "out" / FITS).exists()
    with pytest.raises(BadInput) as together:
        read_given([halves])
    assert str(refused.value) == str(together.value)


def test_a_sheet_that_cannot_be_used_is_named_once(tmp_path):
    table = small().astype({"force_kN": object})
    table.loc[4, "force_kN"] = "x"
    with pd.ExcelWriter(tmp_path / "w.xlsx") as workbook:
        table.to_excel(workbook, sheet_name="S", index=False)
    with pytest.raises(BadInput) as refused:
        fitted(Path(f"{tmp_path / 'w.xlsx'}#S"), tmp_path / "out")
    assert str(refused.value).count("w.xlsx") == 1


def test_what_is_said_of_a_file_names_it(halves, tmp_path):
    table = pd.read_csv(halves / "a.csv")
    written(table.assign(force_kN=1000 * table["force_kN"]), halves / "a.csv")
    given, together = fitted(halves, tmp_path / "out"), read_given([halves / "a.csv"])
    assert given.suspicions == together.suspicions != []


def test_loops_are_fitted_in_one_table(halves, tmp_path):
    command = here("lsq", halves, "--out", tmp_path / "out", "--loops", "--workers", 1)
    assert command.exit_code == 2
    assert "--loops" in command.stderr
