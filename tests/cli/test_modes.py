"""`modes` as a user meets it: what it writes and says, units, a rolling tyre, exit codes, faults."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, files_of, here, tree_of, written
from helpers.hand_made_posteriors import grid, posterior

from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.laws.flexible_ring import FlexibleRing

RADIUS_MM, KG_PER_M = 500.0, 10.0
#: Of a belt of 10 kg/m and 0.5 m radius: EI 75 N m^2, T 85 kN, k_w 2.2 MN/m^2, k_v 0.7 MN/m^2.
RING = FlexibleRing(bending=120.0, tension=3.4e4, radial=2.2e5, tangential=7e4)
TRUE = {"EI": 7.5e4, "T": 85.0, "k_w": 2.2e-3, "k_v": 0.7e-3}


def table(modes: Sequence[int] = range(8), sd: float = 0.3) -> pd.DataFrame:
    n = np.asarray(modes, float)
    noisy = np.asarray(RING.frequencies(n)) + sd * np.random.default_rng(1).standard_normal(len(n))
    return pd.DataFrame({"mode": modes, "frequency_Hz": noisy, "standard_deviation_Hz": sd, "origin": "simulated"})


def test_it_writes_the_belt_s_stiffnesses_in_kN_and_mm_and_says_so(tmp_path):
    path = written(table(), tmp_path / "modes.csv")
    belt = ("--radius", RADIUS_MM, "--mass-per-length", KG_PER_M)
    done = here("modes", path, "--out", tmp_path / "out", *belt)
    assert (done.exit_code, done.stderr) == (0, "")
    names = files_of(tmp_path / "out")
    assert names == {"modes.csv", "frequencies.csv", "run.json", "figures/frequencies_by_mode.png"}
    fitted = pd.read_csv(tmp_path / "out" / "modes.csv").set_index("parameter")
    assert list(fitted.columns) == ["unit", "median", "lower", "upper", "interval", "status", "origin", "verdict"]
    assert fitted["unit"].to_dict() == {"EI": "kN mm^2", "T": "kN", "k_w": "kN/mm^2", "k_v": "kN/mm^2"}
    # The middle of the prior is elsewhere; intervals of 95 % are within a tenth to a fifth of the truth.
    np.testing.assert_allclose(fitted["median"], [TRUE[name] for name in fitted.index], rtol=0.2)
    assert (set(fitted["status"]), set(fitted["verdict"]), set(fitted["origin"])) == ({"ok"}, {"pass"}, {"simulated"})
    frequencies = pd.read_csv(tmp_path / "out" / "frequencies.csv")
    np.testing.assert_allclose(frequencies["frequency_Hz"] - frequencies["fitted_Hz"], frequencies["residual_Hz"])
    assert frequencies["fitted_Hz"].between(frequencies["lower"], frequencies["upper"]).all()
    assert done.stdout.splitlines()[-1] == f"wrote {tmp_path / 'out'}: verdict pass (data: simulated)"
    assert f"k_w {fitted.loc['k_w', 'median']:.4g} [" in done.stdout
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (run["options"]["radius_mm"], run["seed"]) == (RADIUS_MM, 0)
    assert run["options"]["priors"]["tension"]["median"] == 3e4


def test_without_mass_it_gives_ratios_and_what_is_not_identified(tmp_path):
    path = written(table([1, 2]).drop(columns="standard_deviation_Hz"), tmp_path / "modes.csv")
    done = here("modes", path, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    fitted = pd.read_csv(tmp_path / "out" / "modes.csv").set_index("parameter")
    assert list(fitted.index) == ["EI/(rho A R^4)", "T/(rho A R^2)", "k_w/(rho A)", "k_v/(rho A)", "sigma"]
    sums = "; the modes give only k_w + k_v (mode 1), 36 EI/R^4 + 12 T/R^2 + 4 k_w + k_v (mode 2), over rho A"
    status = dict(zip(fitted.index, fitted["status"], strict=True))
    assert status["EI/(rho A R^4)"].startswith("not identified: ")
    assert status["EI/(rho A R^4)"].endswith(sums)
    assert sums not in done.stdout + status["sigma"]
    assert "was not tested" in done.stdout.splitlines()[-1]


def test_a_rolling_tyre_at_two_pressures_has_a_tension_per_bar(tmp_path):
    n, wave = np.array([1.0, 2, 3, 4, 2, 2]), np.array([0.0, 0, 0, 0, 1, -1])
    spin = np.where(wave != 0, 72.0 / 3.6 / 0.5, 0.0)
    ring = FlexibleRing(120.0, 3.4e4 * np.array([1, 1, 1, 1, 0.5, 0.5]), 2.2e5, 7e4)
    rows = pd.DataFrame({"mode": n, "frequency_Hz": ring.frequencies(n, spin, wave), "standard_deviation_Hz": 0.5})
    rows = rows.assign(pressure_bar=[8, 8, 8, 8, 4, 4], speed_km_h=[0, 0, 0, 0, 72, 72])
    path = written(rows.assign(wave=["", "", "", "", "forward", "backward"]), tmp_path / "modes.csv")
    done = here("modes", path, "--out", tmp_path / "out", "--radius", RADIUS_MM)
    assert (done.exit_code, done.stderr) == (0, "")
    fitted = pd.read_csv(tmp_path / "out" / "modes.csv").set_index("parameter")
    (row,) = fitted.loc[["T/(rho A R^2)/p"]].to_dict("records")
    assert row["lower"] < 3.4e4 / 8 < row["upper"]
    assert row["unit"] == "1/s^2/bar"
    before = tree_of(tmp_path / "out")
    refused = here("modes", path, "--out", tmp_path / "out")
    assert_refused(refused.exit_code, refused.stderr, str(path), "speed_km_h", "--radius")
    assert tree_of(tmp_path / "out") == before


def test_frequencies_that_contradict_the_ring_end_with_code_4_and_are_written(tmp_path):
    off = table().assign(frequency_Hz=lambda t: t["frequency_Hz"] + np.where(t["mode"] == 4, 8.0, 0.0))
    done = here("modes", written(off, tmp_path / "modes.csv"), "--out", tmp_path / "out", "--quiet")
    assert (done.exit_code, done.stdout) == (4, "")
    assert "chi-squared" in done.stderr
    assert "mode 4 is off most; check mode numbers" in done.stderr
    assert set(pd.read_csv(tmp_path / "out" / "modes.csv")["verdict"]) == {"fail"}


@pytest.mark.parametrize(
    ("column", "cell", "said"),
    [
        ("mode", 1.5, "is not a whole number of 0 or more"),
        ("frequency_Hz", "n/a", "'n/a' is not a number above 0"),
        ("standard_deviation_Hz", "", "is not a number above 0"),
        ("standard_deviation_Hz", 0, "is not a number above 0"),
        ("wave", "up", "is none of forward, backward"),
        ("speed_km_h", 30, "needs the column wave"),
        ("origin", "guessed", "is none of measured"),
    ],
)
def test_a_cell_that_cannot_be_is_refused_by_row_and_column(column, cell, said, tmp_path):
    rows = table().assign(wave="", speed_km_h=0).astype(object)
    rows.loc[3, column] = cell
    done = here("modes", written(rows, tmp_path / "modes.csv"), "--out", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, "row 4 (line 5)", f"column {column}", said)
    assert not (tmp_path / "out").exists()


def test_columns_that_are_missing_and_a_mass_without_a_radius_are_told(tmp_path):
    path = written(pd.DataFrame({"mode": [1], "Hz": [60.0]}), tmp_path / "modes.csv")
    done = here("modes", path, "--out", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, "missing column frequency_Hz", "found mode, Hz")
    assert here("modes", path, "--out", tmp_path / "out", "--mass-per-length", 10).exit_code == 2


def motions(folder: Path, configurations: tuple[str, ...] = ("single",), known: float = 0.01, **about: str) -> Path:
    """Write what `modes` reads of motions: belts with the ring's mode 1, their frequencies known to a share.

    Of several configurations each has a frequency a tenth higher than the one before.
    """
    factor_table, rng, ratio = grid(configurations), np.random.default_rng(5), 4.0
    groups = len(configurations) * 2
    of_configuration = 1.1 ** np.repeat(np.arange(len(configurations)), 2)
    middle = np.asarray(RING.frequencies(np.array([1.0])))[0] * np.sqrt((1 + ratio) / ratio) * of_configuration
    draws = {"belt_frequency_group": middle * np.exp(known * rng.standard_normal((2, 500, groups)))}
    draws |= {"sidewall_ratio_group": np.full((2, 500, groups), ratio), "k_case": np.ones((2, 500, 2 * groups))}
    tree = posterior(
        draws if about.get("law") != "fancher" else {"k_group": draws["belt_frequency_group"]}, factor_table
    )
    write_tree(tree, folder / "posterior.nc")
    (folder / "diagnostics.json").write_text(json.dumps({"verdict": about.get("verdict", "pass")}))
    (folder / "run.json").write_text("{}")
    return folder


def test_the_first_mode_of_motions_is_fitted_with_the_others(tmp_path):
    rows = table([2, 3, 4, 5]).assign(pressure_bar=7.0).drop(columns="origin")
    path, found = written(rows, tmp_path / "modes.csv"), motions(tmp_path / "motion")
    apart, joint = tmp_path / "apart", tmp_path / "joint"
    assert here("modes", path, "--out", apart, "--quiet").exit_code == 0
    done = here("modes", path, "--out", joint, "--motion", found)
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == f"wrote {joint}: verdict pass (data: origin not stated + simulated)"
    frequencies = pd.read_csv(joint / "frequencies.csv")
    assert frequencies["source"].tolist() == ["table"] * 4 + ["motion"]
    last = frequencies.iloc[-1]
    mode_1 = float(RING.frequencies(np.array([1.0]))[0])
    # Two directions, known to 1 % each: their mean to 0.7 %, itself from 1000 draws.
    assert last["frequency_Hz"] == pytest.approx(mode_1, rel=0.002)
    assert last["standard_deviation_Hz"] == pytest.approx(mode_1 * 0.01 / np.sqrt(2), rel=0.15)
    assert np.isnan(last["pressure_bar"])
    widths = [
        np.log(fitted["upper"] / fitted["lower"])["k_v/(rho A)"]
        for fitted in (pd.read_csv(folder / "modes.csv", index_col="parameter") for folder in (apart, joint))
    ]
    assert widths[1] < widths[0] / 2  # k_v counts in low modes
    fitted = pd.read_csv(joint / "modes.csv", index_col="parameter").loc["k_v/(rho A)"].to_dict()
    assert fitted["lower"] < 7e4 < fitted["upper"]
    assert list(json.loads((joint / "run.json").read_text())["inputs"]) == [str(path), str(found / "posterior.nc")]


def test_of_several_configurations_one_is_named(tmp_path):
    path, found = written(table(), tmp_path / "modes.csv"), motions(tmp_path / "motion", ("dual", "single"))
    asked = ("modes", path, "--out", tmp_path / "out", "--motion", found)
    for options, said in (((), "several configurations"), (("--configuration", "x"), "has no 'x'")):
        refused = here(*asked, *options)
        assert_refused(refused.exit_code, refused.stderr, "posterior.nc", said, "one of dual, single")
    assert here(*asked, "--configuration", "dual", "--quiet").exit_code == 0
    # The belt of `single` is a tenth higher than that of the table: 6 Hz, and known to 0.4 Hz.
    other = here(*asked, "--configuration", "single", "--quiet")
    assert other.exit_code == 4
    assert "mode 1 is off most" in other.stderr
    assert here("modes", path, "--out", tmp_path / "out", "--configuration", "dual").exit_code == 2


@pytest.mark.parametrize(
    ("made", "said"),
    [({"law": "fancher"}, "no posterior of a rigid ring"), ({"known": 0.3}, "do not determine the first mode")],
)
def test_motions_that_did_not_find_the_mode_are_refused(made, said, tmp_path):
    path, found = written(table(), tmp_path / "modes.csv"), motions(tmp_path / "motion", **made)
    done = here("modes", path, "--out", tmp_path / "out", "--motion", found)
    assert_refused(done.exit_code, done.stderr, str(found / "posterior.nc"), said)
    bare = written(table().drop(columns="standard_deviation_Hz"), tmp_path / "bare.csv")
    done = here("modes", bare, "--out", tmp_path / "out", "--motion", found)
    assert_refused(done.exit_code, done.stderr, str(bare), "no column standard_deviation_Hz")
    assert not (tmp_path / "out").exists()


def test_motions_that_are_not_to_be_trusted_pass_that_on(tmp_path):
    path, found = written(table(), tmp_path / "modes.csv"), motions(tmp_path / "motion", verdict="fail")
    done = here("modes", path, "--out", tmp_path / "out", "--motion", found, "--quiet")
    assert (done.exit_code, done.stdout) == (4, "")
    assert (
        done.stderr
        == f"bayes-tyre: the verdict on {found} is fail, and the first mode comes from it; leave --motion out\n"
    )
    assert set(pd.read_csv(tmp_path / "out" / "modes.csv")["verdict"]) == {"fail"}
