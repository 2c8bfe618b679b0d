"""`lsq --loops` on the two measured loops, and what `show` and `report` make of it."""

import re
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import files_of, here, written
from scipy.signal import find_peaks

from bayes_tyre.embedded import data_path

# Compilation and the module's fixture: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

STEEL, DAMPER = "steel_slit_damper", "magnetorheological_damper"


def measured(name: str) -> pd.DataFrame:
    """Return a measured loop, without the magnetorheological damper's rest before it moves."""
    return pd.read_csv(data_path(f"measured/{name}.csv")).iloc[60 if name == DAMPER else 0 :].reset_index(drop=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return what the command wrote of both loops in one table, with columns that a curve cannot have."""
    path = tmp_path_factory.mktemp("loops")
    both = pd.concat(
        [measured(name).drop(columns="time_s", errors="ignore").assign(record=name) for name in (STEEL, DAMPER)]
    )
    both["direction"] = np.where(np.arange(len(both)) % 2, "loading", "unloading")
    written(both.assign(step_kN=10.0, origin="measured"), path / "curves.csv")
    done = here("lsq", path / "curves.csv", "--loops", "--out", path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    (path / "out" / "said").write_text(done.stdout)
    return path / "out"


def test_it_writes_branches_cycles_backbones_and_a_figure_and_says_so(folder):
    names = files_of(folder) - {"said"}
    assert names == {"least_squares.csv", "loops.csv", "backbone.csv", "figures/loops.png"}
    fits, loops, backbones = (pd.read_csv(folder / f"{name}.csv") for name in ("least_squares", "loops", "backbone"))
    assert fits.groupby("loop", sort=False)["branch"].max().to_dict() == {STEEL: 15, DAMPER: 24}
    assert loops.groupby("record", sort=False)["cycle"].max().to_dict() == {STEEL: 7, DAMPER: 12}
    assert len(backbones) == 101 * len(loops)
    assert list(fits.columns[-5:]) == ["status", "loop", "branch", "cycle", "origin"]
    assert fits["record"][0] == f"{STEEL} 1"
    assert (fits["step_kN"].isna()).all()
    ways = [fits.loc[fits["loop"] == name, "direction"].to_list() for name in (STEEL, DAMPER)]
    assert all(before != after for each in ways for before, after in pairwise(each))
    said = (folder / "said").read_text()
    assert "19 closed cycles" in said
    assert said.splitlines()[-1] == f"39 branches, {(fits['status'] != 'ok').sum()} not ok"
    assert "(data: measured)" in said


def polygon(d: np.ndarray, F: np.ndarray) -> float:
    """Return the area of a polygon by the shoelace formula, positive clockwise."""
    return 0.5 * float(np.sum(np.roll(d, -1) * F - d * np.roll(F, -1)))


def test_the_steel_damper_s_energies_are_its_polygons_and_the_law_s_are_near_where_it_is_ok(folder):
    loops = pd.read_csv(folder / "loops.csv").query("record == @STEEL")
    d, F = measured(STEEL)[["displacement_mm", "force_kN"]].to_numpy().T
    # The digitised curve has no noise: its reversals are its peaks, but for a first one of less than 5 % of the travel.
    peaks = [find_peaks(sign * d, prominence=0.05 * np.ptp(d))[0] for sign in (1, -1)]
    turns = [*sorted(np.concatenate(peaks)), len(d) - 1]
    assert len(turns) == 2 * len(loops) + 1 == 15
    for row, first, last in zip(loops.itertuples(), turns[:-2:2], turns[2::2], strict=True):
        points = slice(first, last + 1)
        assert row.energy_J == pytest.approx(polygon(d[points], F[points]), rel=1e-9)
        assert (row.travel_mm, row.points) == (np.ptp(d[points]), last + 1 - first)
    ok = loops[loops["status"] == "ok"]
    assert len(ok) == 3
    assert (ok["energy_difference_J"].abs() < 0.01 * ok["energy_J"]).all()
    assert loops["energy_drift"].iloc[-1] == pytest.approx(loops["energy_J"].iloc[-1] / loops["energy_J"].iloc[0] - 1)


def test_the_damper_that_follows_speed_is_not_called_this_law_s(folder):
    fits, loops = (pd.read_csv(folder / f"{name}.csv") for name in ("least_squares", "loops"))
    assert fits.loc[fits["loop"] == DAMPER, "status"].str.contains("the curve is not Equation 2").all()
    mine = loops[loops["record"] == DAMPER]
    assert not (mine["status"] == "ok").any()
    # Force is nearly constant, so that its energy is force times travel, within the corners.
    assert mine["energy_J"].between(12.0, 13.5).all()
    assert mine["energy_drift"].iloc[-1] == pytest.approx(-0.03, abs=0.02)


def test_show_and_report_take_the_folder(folder):
    shown = here("show", folder)
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "fits of Equation 2 (data: measured): 39 rows" in shown.stdout
    assert "of the 19 further rows 18: the curve is not Equation 2" in shown.stdout
    assert "closed cycles (data: measured): 19 rows, 16 not ok" in shown.stdout
    done = here("report", folder)
    assert (done.exit_code, done.stdout) == (0, f"wrote {folder / 'report.html'}\n")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1
    assert len(re.findall(r"<tr>", page)) == 2 + 39 + 19
    (folder / "report.html").unlink()
