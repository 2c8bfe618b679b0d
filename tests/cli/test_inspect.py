"""The command `inspect`: its table, its warnings, and what it refuses."""

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, tree_of

from bayes_tyre.embedded import data_path

SAMPLE = data_path("sample/appendix_b1.lvm")
COLUMNS = ["file", "segment", "channel", "unit", "samples", "dt_s", "first", "last", "min", "max", "missing"]
TABLE = "X_Value\tacc\tload\n0.0\t1.5\t\n0.5\t\t-2.5\n1.0\t-1.5\tNaN\n1.5\t0.5\t-3.5\n"


@pytest.fixture
def lab(tmp_path):
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "b.lvm").write_bytes(SAMPLE.read_bytes())
    (folder / "a.lvm").write_text(TABLE)
    return folder


def test_a_row_a_channel(lab, tmp_path):
    done = here("inspect", lab, "--out", tmp_path / "out" / "channels.csv")
    assert done.exit_code == 0
    assert done.stdout == f"wrote {tmp_path / 'out' / 'channels.csv'}\n"
    table = pd.read_csv(tmp_path / "out" / "channels.csv", keep_default_na=False, na_values={"dt_s": [""]})
    assert list(table.columns) == COLUMNS
    assert list(table["file"]) == [str(lab / "a.lvm")] * 2 + [str(lab / "b.lvm")] * 7
    assert list(table["channel"])[:2] == ["acc", "load"]
    assert set(table["segment"]) == {1}
    assert list(table.loc[0, COLUMNS[4:]]) == [4, 0.5, 1.5, 0.5, -1.5, 1.5, 1]
    assert list(table.loc[1, COLUMNS[4:]]) == [4, 0.5, -2.5, -3.5, -3.5, -2.5, 2]
    last = table.iloc[-1]
    assert (last["channel"], last["unit"], last["samples"], last["missing"]) == ("Time Elapsed", "", 1, 0)
    assert np.isnan(last["dt_s"])
    assert table.loc[2, "unit"] == "Volts"
    assert table.loc[2, "dt_s"] == 0.0001
    assert list(table.loc[2, COLUMNS[6:10]]) == [3.489576, 3.486068, 3.483779, 3.491102]
    assert done.stderr.startswith(f"bayes-tyre: warning: {lab / 'b.lvm'}: 'Raw Acc Voltage', ")
    promised, uneven = done.stderr.splitlines()
    assert promised.endswith("27 samples, the header promises 150000")
    assert uneven.endswith("samples are 0.0001 s apart, but 0.0003 s after sample 15 (and 3 more places)")


def test_to_the_terminal_and_quiet(lab):
    done = here("inspect", lab / "a.lvm")
    assert done.exit_code == 0
    lines = [line.split() for line in done.stdout.splitlines() if line.strip(" ─━-")]
    assert lines[0] == COLUMNS
    assert lines[1] == [str(lab / "a.lvm"), "1", "acc", "4", "0.5", "1.5", "0.5", "-1.5", "1.5", "1"]
    assert len(lines) == 3
    quiet = here("inspect", SAMPLE, "--quiet")
    assert quiet.stdout == ""
    assert quiet.stderr.count("\n") == 2


def test_a_channel_without_a_reading_and_one_without_a_sample(tmp_path):
    text = SAMPLE.read_text().replace("15144.000000", "").replace("\t150000\t1\t", "\t150000\t0\t")
    (tmp_path / "a.lvm").write_text(text)
    done = here("inspect", tmp_path, "--out", tmp_path / "a.csv", "--quiet")
    assert done.exit_code == 0
    last = pd.read_csv(tmp_path / "a.csv").iloc[-1]
    assert last["samples"] == last["missing"] == 0
    assert last[COLUMNS[6:10]].isna().all()


def test_bad_files_are_said_the_others_listed_and_nothing_is_written(lab, tmp_path):
    for name in ("c.lvm", "d.lvm"):
        (lab / name).write_text(TABLE.replace("-1.5", "broken"))
    before = tree_of(tmp_path)
    for out in ([], ["--out", tmp_path / "out.csv"]):
        done = here("inspect", lab, *out)
        *warnings, last = done.stderr.splitlines(keepends=True)
        assert_refused(
            done.exit_code, last, "2 of 4 files cannot be read", *(["out.csv is not written"] if out else [])
        )
        for name in ("c.lvm", "d.lvm"):
            assert f"{lab / name}: line 4, column acc: 'broken'" in "".join(warnings)
        assert len(warnings) == 4  # and those on the sample
        assert [done.stdout.count(str(lab / name)) for name in ("a.lvm", "b.lvm", "c.lvm")] == [2, 7, 0]
    done = here("inspect", lab / "c.lvm", "--out", tmp_path / "out.csv")
    assert_refused(done.exit_code, done.stderr, "c.lvm", "line 4", "acc", "'broken'")
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.lvm"], "no such file"),
        (["."], "holds no recording"),
        (["a.wav"], "no kind of recording"),
        ([SAMPLE, "--out", "a.txt"], "name one"),
        ([SAMPLE, "--out", "."], "name one"),
        ([SAMPLE, "--out", "a.wav/b.csv"], "name a folder"),
    ],
)
def test_what_is_refused(tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.wav").write_text("")
    done = here("inspect", *arguments)
    assert_refused(done.exit_code, done.stderr, said)
    assert tree_of(tmp_path) == {"a.wav": b""}


def test_names_that_would_steer_a_terminal_or_a_spreadsheet_are_text(tmp_path):
    hostile = "\x1b[31m[red]=1+1[/red]"
    text = SAMPLE.read_text().replace("Disp mm", hostile).replace("Load kN", "=HYPERLINK(0)")
    path = tmp_path / "[bold]a [red]\x1b[2J.lvm"
    path.write_text(text)
    done = here("inspect", path)
    assert done.exit_code == 0
    assert "\x1b" not in done.stdout + done.stderr
    assert "\N{REPLACEMENT CHARACTER}[31m[red]=1+1[/red]" in done.stdout
    assert "[bold]a [red]\N{REPLACEMENT CHARACTER}[2J.lvm" in done.stdout
    assert here("inspect", path, "--out", tmp_path / "a.csv", "--quiet").exit_code == 0
    written = (tmp_path / "a.csv").read_text()
    assert "'=HYPERLINK(0)" in written
    assert hostile in written


def test_a_path_that_is_no_text(tmp_path):
    path = tmp_path / "a\udcff.lvm"
    path.write_text(TABLE)
    done = here("inspect", tmp_path, "--out", tmp_path / "a.csv")
    assert done.exit_code == 0
    assert "a\\udcff.lvm" in (tmp_path / "a.csv").read_text()
