"""`lsq` as a user meets it: what it prints and writes, bounds, further columns, odd records, progress."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.certified_sets import SETS
from helpers.command_line import (
    COMMAND,
    FACTORS,
    LONGEST,
    assert_refused,
    environment,
    files_of,
    here,
    installed,
    printed_and_imported,
    small,
    tree_of,
    written,
)
from helpers.simulated_records import Plan, simulate

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

NUMBERS = [
    name
    for parameter in ("k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN")
    for name in (parameter, f"{parameter}_se")
]


def result(folder: Path) -> pd.DataFrame:
    """`least_squares.csv`, cells as they are written."""
    return pd.read_csv(folder / "least_squares.csv", keep_default_na=False, dtype=str)


def test_lsq_waits_for_no_library_that_it_does_not_need(tmp_path):
    table, _ = simulate(Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=200), 2)
    written(table, tmp_path / "records.csv")
    heavy = ("numpyro", "arviz", "xarray", "matplotlib", "scipy.stats", "scipy.io", "h5py", "openpyxl")
    command = ["lsq", "records.csv", "--out", "lsq", "--quiet"]
    assert printed_and_imported([command], heavy, tmp_path) == ([""], [])


def test_lsq_needs_only_the_required_columns_and_one_bad_record_stops_no_other(tmp_path):
    table, truth = simulate(
        Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=200), 2
    )
    required = table[["record", "displacement_mm", "force_kN"]]
    names = truth["record"].tolist()
    few = required[required["record"] == names[0]].head(3).assign(record="short")
    still = required[required["record"] == names[0]].assign(record="still", displacement_mm=5.0)
    written(pd.concat([few, required, still]), tmp_path / "records.csv")
    done = installed("lsq", "records.csv", "--out", "made/here", "--free", "F_i", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.splitlines()[-1] == "5 records, 2 not ok"
    assert str(Path("made/here/least_squares.csv")) in done.stdout
    assert files_of(tmp_path / "made") == {"here/least_squares.csv"}
    fits = pd.read_csv(tmp_path / "made/here/least_squares.csv", keep_default_na=False, dtype=str)
    parameters = ("k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN")
    numbers = [name for parameter in parameters for name in (parameter, f"{parameter}_se")]
    assert list(fits.columns) == ["record", *FACTORS, *numbers, "rmse_kN", "points", "status", "origin"]
    assert (fits[FACTORS] == "").all(axis=None)
    assert fits["record"].tolist() == ["short", *names, "still"]
    status = dict(zip(fits["record"], fits["status"], strict=True))
    assert "too few points" in status["short"]
    assert "no travel" in status["still"]
    assert fits.set_index("record").loc[["short", "still"], numbers].isin([""]).all(axis=None)
    good = fits[fits["record"].isin(names)]
    assert (good["status"] == "ok").all()
    assert (good["d_i_mm_se"] == "").all()
    assert (good["points"] == "200").all()
    distance = good["k_kN_per_mm"].astype(float).to_numpy() - truth["k"].to_numpy()
    assert (np.abs(distance) < 5 * good["k_kN_per_mm_se"].astype(float).to_numpy()).all()


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [("force_kN", 1000.0, "divide by 1000"), ("displacement_mm", 0.001, "multiply by 1000")],
)
def test_lsq_warns_of_newtons_and_metres_and_goes_on_while_fit_refuses(column, factor, said, tmp_path):
    table = small()
    table[column] *= factor
    path = written(table, tmp_path / "records.csv")
    before = tree_of(tmp_path)
    refused = here("fit", path, "--out", tmp_path / "fit")
    assert_refused(refused.exit_code, refused.stderr, str(path), column, said, "--units-checked")
    assert tree_of(tmp_path) == before
    warned = here("lsq", path, "--out", tmp_path / "lsq")
    assert warned.exit_code == 0
    assert warned.stderr.startswith("bayes-tyre: warning: ")
    assert warned.stderr.count("\n") == 1
    assert column in warned.stderr
    assert said in warned.stderr
    assert (tmp_path / "lsq" / "least_squares.csv").is_file()
    quiet = here("lsq", path, "--out", tmp_path / "lsq", "--quiet")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", warned.stderr)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("start", ["NIST 1", "NIST 2", None])
def test_certified_sets_come_back_to_eight_digits(name, start, tmp_path):
    """Equation 2 without stiffness; from NIST's starts, far and near, and from the data's own."""
    its = SETS[name]
    table = pd.DataFrame({"record": name, "displacement_mm": its.x, "force_kN": its.y})
    path = written(table, tmp_path / "certified.csv")
    options = [text for parameter in ("k", "d_i", "F_i") for text in ("--fix", f"{parameter}=0")]
    if start:
        b1, b2 = its.starts[start]
        options += ["--start", f"C={b1}", "--start", f"beta={1 / b2!r}"]
    done = here("lsq", path, "--out", tmp_path, *options)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "1 records, 0 not ok"
    row = pd.read_csv(tmp_path / "least_squares.csv").iloc[0]
    assert row["C_kN"] == pytest.approx(its.b1, rel=1e-8)
    assert row["beta_mm"] == pytest.approx(1 / its.b2, rel=1e-8)
    assert row["C_kN_se"] == pytest.approx(its.b1_sd, rel=1e-8)
    assert row["beta_mm_se"] == pytest.approx(its.b2_sd / its.b2**2, rel=1e-8)
    assert row["rmse_kN"] == pytest.approx(its.residual_sd * np.sqrt(1 - 2 / len(its.x)), rel=1e-8)
    assert row[["k_kN_per_mm_se", "d_i_mm_se", "F_i_kN_se"]].isna().all()


def test_the_answer_is_of_this_run_whatever_else_is_in_the_folder(tmp_path):
    path, out = written(small(), tmp_path / "records.csv"), tmp_path / "out"
    assert here("lsq", path, "--out", out).stdout.endswith("6 records, 0 not ok\n")
    (out / "load_deflection.csv").write_text("of another command, and not even whole")
    (out / "run.json").write_text("{}")
    again = here("lsq", path, "--out", out)
    assert (again.exit_code, again.stderr) == (0, "")
    assert again.stdout.endswith("6 records, 0 not ok\n")


def test_bounds_are_held_and_said(tmp_path):
    path = written(small(), tmp_path / "records.csv")
    done = here("lsq", path, "--out", tmp_path / "free")
    k = result(tmp_path / "free")["k_kN_per_mm"].astype(float)
    bound = float(np.round(k.median(), 4))
    done = here("lsq", path, "--out", tmp_path / "bounded", "--bounds", f"k=0:{bound}", "--bounds", "beta=:5")
    assert done.exit_code == 0, done.stderr
    fits = result(tmp_path / "bounded")
    above = (k > bound).to_numpy()
    assert 0 < above.sum() < len(k)
    assert (fits["status"] == f"k at its bound {bound:g}").tolist() == above.tolist()
    assert (fits["k_kN_per_mm"].astype(float) <= bound).all()
    assert (fits["k_kN_per_mm_se"] == "").tolist() == above.tolist()
    assert done.stdout.splitlines()[-1] == f"{len(k)} records, {above.sum()} not ok"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--bounds", "k"], "'k' is not NAME=LOW:HIGH"),
        (["--bounds", "k=1"], "'k=1' is not NAME=LOW:HIGH"),
        (["--bounds", "=0:1"], "'=0:1' is not NAME=LOW:HIGH"),
        (["--bounds", "k=low:1"], "'k=low:1' is not NAME=LOW:HIGH"),
        (["--bounds", "k=0:1:2"], "'k=0:1:2' is not NAME=LOW:HIGH"),
        (["--bounds", "k=:"], "k=: bounds neither side"),
        (["--bounds", "k=2:1"], "k=2:1 leaves no room"),
        (["--bounds", "k=nan:1"], "k=nan:1 leaves no room"),
        (["--bounds", "beta=:0"], "beta=:0 excludes every beta"),
        (["--bounds", "x=0:1"], "'x' is unknown"),
        (["--bounds", "d_i=0:1"], "add --free d_i"),
        (["--bounds", "k=0:1", "--bounds", "k=:2"], "k is bounded twice"),
        (["--bounds", "k=0:1", "--fix", "k=2"], "k is fixed and also bounded"),
        (["--bounds", "k=0:1", "--start", "k=2"], "k=0:1 excludes the start 2"),
    ],
)
def test_bounds_that_cannot_be_are_a_usage_error_and_nothing_is_read(options, said, tmp_path):
    done = here("lsq", tmp_path / "not there.csv", "--out", tmp_path / "out", *options)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.replace("│", " ").split())
    assert tree_of(tmp_path) == {}


def test_further_columns_come_along_and_what_cannot_is_said_in_one_line(tmp_path):
    table = small().assign(pressure_bar=7.25, status="checked", note=lambda t: "row " + t.index.astype(str))
    done = installed("lsq", written(table, tmp_path / "records.csv"), "--out", ".", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr.startswith("bayes-tyre: warning: column note: text that varies within a record")
    assert done.stderr.count("\n") == 1
    fits = result(tmp_path)
    assert list(fits.columns) == [
        *("record", *FACTORS, *NUMBERS, "rmse_kN", "points", "status"),
        *("pressure_bar", "given_status", "origin"),
    ]
    assert set(fits["pressure_bar"]) == {"7.25"}
    assert set(fits["given_status"]) == {"checked"}


ODD = {
    "huge force": (lambda t: t.assign(force_kN=1e308), "too large"),
    "huge both ways": (lambda t: t.assign(force_kN=np.where(t.index % 2, 1.7e308, -1.7e308)), "too large"),
    "huge displacement": (lambda t: t.assign(displacement_mm=np.where(t.index % 2, 1.7e308, -1.7e308)), "too large"),
    "no travel": (lambda t: t.assign(displacement_mm=3.0), "no travel"),
    "one point": (lambda t: t.head(1), "too few points: 1 for 3"),
    "two points": (lambda t: t.head(2), "too few points: 2 for 3"),
    "there and back": (lambda t: pd.concat([t, t.iloc[::-1]]), "turns back"),
    "constant force": (lambda t: t.assign(force_kN=10.0), "beta not determined"),
    "falling force": (lambda t: t.assign(force_kN=-t["force_kN"]), "force falls"),
}


@pytest.mark.parametrize("region", ["all", "thesis"])
def test_odd_records_are_rows_with_a_reason_and_the_last_line_counts_them(region, tmp_path):
    table = small()
    one = table[table["record"] == table["record"].iloc[0]].reset_index(drop=True)
    odd = [change(one).assign(record=name, configuration=name) for name, (change, _) in ODD.items()]
    columns = ["record", "displacement_mm", "force_kN"]
    path = written(pd.concat([table, *odd])[columns], tmp_path / "records.csv")
    done = here("lsq", path, "--out", tmp_path, "--region", region)
    assert done.exit_code == 0, done.stderr
    assert done.stderr == ""
    status = result(tmp_path).set_index("record")["status"]
    for name, (_, said) in ODD.items():
        if region == "all" or name != "there and back":
            assert said in status[name], name
    good = status.drop(list(ODD))
    assert set(good) == {"ok"}
    odd_ones = int((status != "ok").sum())
    assert done.stdout.splitlines()[-1] == f"{len(status)} records, {odd_ones} not ok"


def test_progress_is_drawn_where_stderr_is_a_terminal_and_nowhere_else(tmp_path):
    path = written(small(), tmp_path / "records.csv")
    drawn = {}
    for quiet in ([], ["--quiet"]):
        ours, its = os.openpty()
        command = [str(COMMAND), "lsq", str(path), "--out", str(tmp_path / "out"), *quiet]
        env = environment() | {"TERM": "xterm-256color"}
        process = subprocess.Popen(command, cwd=tmp_path, env=env, stdout=subprocess.DEVNULL, stderr=its)
        os.close(its)
        drawn["quiet" if quiet else "bar"] = read_all(ours)
        assert process.wait(timeout=LONGEST) == 0
    assert "least squares" in drawn["bar"]
    assert "6/6" in drawn["bar"]
    assert drawn["quiet"] == ""


def read_all(terminal: int) -> str:
    """What was drawn until the other side closed."""
    parts = []
    while True:
        try:
            part = os.read(terminal, 65536)
        except OSError:  # so a terminal says that nobody writes any more
            part = b""
        if not part:
            os.close(terminal)
            return b"".join(parts).decode(errors="replace")
        parts.append(part)
