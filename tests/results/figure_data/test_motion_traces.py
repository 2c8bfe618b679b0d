"""Which records' motions are shown, their readings as a table, and their pictures in the report."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.drawings import said, sticking_out
from matplotlib.colors import to_hex

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.report.figures.motion import motion_figure
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.html.figures import embedded_figure
from bayes_tyre.results.figure_data.motion_traces import COLUMNS, check_readings, places, readings_table
from bayes_tyre.workflow.raw.motion_estimates import MISFIT, READINGS, shown_motions

SCRIPT = "<script>alert(1)</script>"


def readings(seed: int = 0, blocks: int = 40, missing: int = 5) -> pd.DataFrame:
    """Return a table of known residuals: readings of 1 standard deviation about nothing, the last of them missing."""
    rng = np.random.default_rng(seed)
    off, expected = rng.normal(size=(3, blocks)), np.zeros((3, blocks))
    weight = np.where(np.arange(blocks) < blocks - missing, 2.0, 0.0) * np.ones((3, 1))
    nothing = jnp.zeros(1), jnp.zeros((2, 1))
    window = Window(jnp.asarray(5e-4), jnp.asarray(-off / 2.0), jnp.asarray(weight), *nothing)
    return readings_table(window, expected, off)


def told(table: pd.DataFrame, **factor_table: str) -> pd.DataFrame:
    return table.assign(
        **{"record": "S", "configuration": "single", "shown": "worst", "status": "ok"} | factor_table
    ).assign(origin="simulated")


def test_readings_less_fitted_motion_are_what_is_left_over_and_what_is_not_there_is_empty():
    table = readings()
    assert tuple(table) == COLUMNS
    for name, unit in (("acceleration", "m_per_s2"), ("laser", "mm"), ("load", "kN")):
        left = (table[f"{name}_{unit}"] - table[f"fitted_{name}_{unit}"]) * 2.0
        np.testing.assert_allclose(left, table[f"left_over_{name}"])
        assert table[f"{name}_{unit}"].isna().sum() == 5
    np.testing.assert_allclose(np.diff(table["time_s"]), 5e-4)


@pytest.mark.parametrize(
    ("trusted", "misfit", "shown"),
    [
        ([True], [0.5], {"typical": 0}),
        ([True, True], [0.5, 0.7], {"worst": 1, "typical": 0}),
        # One that failed its check is worse than any that passed, and the typical one is not of those shown already.
        ([True, False, True, True], [0.9, 0.2, 0.5, 0.6], {"worst": 1, "second_worst": 0, "typical": 2}),
        ([False] * 5, [3.0, 1.0, 2.0, 5.0, 4.0], {"worst": 3, "second_worst": 4, "typical": 2}),
    ],
)
def test_the_two_worst_and_a_typical_record_are_shown(trusted, misfit, shown):
    assert places(np.array(trusted), np.array(misfit)) == shown


def test_parts_give_the_readings_of_those_records_back(tmp_path):
    tables = [readings(seed) for seed in range(3)]
    for i, table in enumerate(tables):
        row = {"record": f"r{i}", "configuration": "single", "status": "ok", "origin": "simulated", MISFIT: 0.1 * i}
        pd.DataFrame([row | {READINGS: table.to_numpy().ravel().tolist()}]).to_parquet(tmp_path / f"{i}.part")
    parts = sorted(tmp_path.glob("*.part"))
    shown = shown_motions(parts)
    assert shown is not None
    assert shown.groupby("shown", sort=False)["record"].first().to_dict() == {
        **{"worst": "r2", "second_worst": "r1", "typical": "r0"}
    }
    mine = shown[shown["record"] == "r1"]
    pd.testing.assert_frame_equal(mine[list(COLUMNS)].reset_index(drop=True), tables[1])
    old = [_without_readings(part) for part in parts]
    assert shown_motions(old) is None


def _without_readings(part: Path) -> Path:
    path = part.with_suffix(".old")
    pd.read_parquet(part).drop(columns=[MISFIT, READINGS]).to_parquet(path)
    return path


def test_the_picture_is_in_the_configurations_colour_and_its_labels_are_text():
    hostile = told(readings(), record=SCRIPT, status="Pareto k 1.1, $\\frac{")
    figure = motion_figure(hostile, Setting("simulated", "fail", ("dual", "single")))
    colours = {to_hex(line.get_color()) for ax in figure.get_axes() for line in ax.lines}
    assert Setting("measured").looks(["single"])["single"].colour.lower() in colours
    assert Setting("measured").looks(["dual"])["dual"].colour.lower() not in colours
    texts = said(figure)
    assert {"acceleration (m/s²)", "laser (mm)", "cylinder load (kN)"} <= set(texts)
    assert "data: simulated, not measured" in texts
    assert not sticking_out(figure)
    shown = embedded_figure("motion_worst", figure)
    assert shown.heading == "The motion of the record that the fit follows worst"
    assert SCRIPT in shown.alternative.replace("\n", " ")  # text, which the template escapes
    assert "Check of the estimate: Pareto k 1.1" in shown.alternative


@pytest.mark.parametrize("spoil", ["a column is gone", "a number is a word", "no rows"])
def test_a_table_that_motion_did_not_write_is_refused(spoil):
    table = told(readings())
    assert check_readings(table, "m.csv") is table
    spoilt = {
        "a column is gone": lambda: table.drop(columns="laser_mm"),
        "a number is a word": lambda: table.assign(laser_mm="much"),
        "no rows": lambda: table.iloc[:0],
    }[spoil]()
    with pytest.raises(BadInput, match=r"m\.csv: is not what motion writes: column (laser_mm|record)"):
        check_readings(spoilt, "m.csv")


def test_what_is_left_over_of_a_record_is_laid_over_the_band_of_noise():
    figure = motion_figure(told(readings()), Setting("simulated"))
    right = figure.get_axes()[1]
    drawn = np.concatenate([np.asarray(line.get_ydata(), float) for line in right.lines if line.get_marker() == "."])
    np.testing.assert_allclose(drawn, readings()["left_over_acceleration"])
    assert "where 95 % should lie" in said(figure)
