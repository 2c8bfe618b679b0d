"""`process --cases`: the factors and the rig of files whose names do not tell them."""

import shutil

import numpy as np
import pandas as pd
from helpers.command_line import assert_refused, here, tree_of
from helpers.process_recordings import FACTORS, GOOD

from bayes_tyre.embedded import data_path


def test_cases_name_what_names_do_not(recordings, tmp_path):
    row = {"file": "run7.lvm", "configuration": "wide", "speed_km_h": 0, "initial_load_kN": 30, "step_kN": -10}
    pd.DataFrame([{**row, "repeat": 2}]).to_csv(tmp_path / "cases.csv", index=False)
    options = ["--cases", tmp_path / "cases.csv", "--rig", "single", "--out", tmp_path / "r.csv"]
    assert here("process", recordings / "run7.lvm", *options).exit_code == 0
    records = pd.read_csv(tmp_path / "r.csv")
    assert set(records["record"]) == {"run7"}
    assert records[FACTORS].drop_duplicates().to_numpy().tolist() == [["wide", "unloading", 0.0, 30.0, -10.0, 2]]
    assert set(records["origin"]) == {"simulated"}
    alone = here("process", recordings / "run7.lvm", *options[:2], *options[4:])
    assert_refused(alone.exit_code, alone.stderr, "--rig", "'wide'")


def test_a_row_of_the_cases_names_a_rig_file(recordings, tmp_path):
    folder = tmp_path / "campaign"
    (folder / "rigs").mkdir(parents=True)
    single = data_path("rigs/single.toml").read_text()
    assert "1300" in single
    (folder / "rigs" / "long.toml").write_text(single.replace("1300", "1301"))
    row = {"configuration": "wide", "speed_km_h": 0, "initial_load_kN": 30, "step_kN": -10, "repeat": 1}
    shutil.copy(recordings / GOOD[0], tmp_path / "a.lvm")
    shutil.copy(recordings / GOOD[0], tmp_path / "b.lvm")
    cases = folder / "cases.csv"

    def displacements(rig_of_a: str, *options: object) -> tuple[np.ndarray, np.ndarray]:
        table = pd.DataFrame([{"file": "a.lvm", **row, "rig": rig_of_a}, {"file": "b.lvm", **row, "rig": ""}])
        table.to_csv(cases, index=False)
        files = [tmp_path / "a.lvm", tmp_path / "b.lvm"]
        done = here("process", *files, "--cases", cases, "--out", tmp_path / "r.csv", "--workers", 1, *options)
        assert done.exit_code == 0, done.stderr
        records = pd.read_csv(tmp_path / "r.csv").groupby("record")["displacement_mm"]
        return tuple(records.get_group(name).to_numpy() for name in ("a", "b"))

    a, b = displacements("rigs/long.toml", "--rig", "single")
    np.testing.assert_array_equal(displacements("single", "--rig", folder / "rigs" / "long.toml")[1], a)
    assert not np.array_equal(a, b)
    (folder / "rigs" / "long.toml").write_text(single.replace("1300", "1302"))
    resumed, _ = displacements("rigs/long.toml", "--rig", "single", "--resume")
    assert not np.array_equal(resumed, a)
    pd.DataFrame([{"file": "a.lvm", **row, "rig": "none.toml"}]).to_csv(cases, index=False)
    before = tree_of(tmp_path)
    refused = here("process", tmp_path / "a.lvm", "--cases", cases, "--out", tmp_path / "s.csv")
    assert_refused(refused.exit_code, refused.stderr, "'a.lvm', column rig", "none.toml: no such rig file")
    assert tree_of(tmp_path) == before
