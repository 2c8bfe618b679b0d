"""The figure of slow tests: what is drawn of a case, what is said, and that it stays on its page."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import said, sticking_out

from bayes_tyre.report.figures.load_deflection import LoopPanel, load_deflection_loops
from bayes_tyre.report.figures.page.colours import Setting

SETTING = Setting("simulated", configurations=("dual", "single"))


def panel(name: str = "single, 0 km/h, mean of 3", configuration: str = "single", **fit: float) -> LoopPanel:
    up = np.linspace(2, 18, 9)
    d = np.concatenate([up, up[-2::-1]])
    loading = np.arange(17) <= 8
    force = 1.5 * d + 0.3 + np.where(loading, 0.6, -0.6)
    readings = pd.DataFrame({"flat_ground_mm": d, "flat_ground_kN": force})
    readings["direction"] = np.where(loading, "loading", "unloading")
    readings = readings.assign(on_loading_line=loading, on_unloading_line=np.arange(17) >= 8)
    lines = {"k_loading_kN_per_mm": 1.5, "C_loading_kN": 0.9, "k_unloading_kN_per_mm": 1.52, "C_unloading_kN": -0.4}
    law = {"k_kN_per_mm": 1.5, "C_kN": 0.3, "x_less_k_beta_kN": 0.6, "x_less_k_beta_kN_se": 0.01}
    bounds = {"x_kN": np.nan, "x_low_kN": 0.6, "x_high_kN": 1.5, "energy_per_cycle_J": 19.2, "stroke_mm": 17.0}
    loop = np.array([[2, 3.9], [18, 27.9], [18, 26.7], [2, 2.7], [2, 3.9]])
    return LoopPanel(name, configuration, readings, {**lines, **law, **bounds, **fit}, loop)


@pytest.fixture(scope="module")
def figure():
    return load_deflection_loops([panel(), panel("dual $x^$ " + "long " * 30, "dual", x_kN=0.675)], SETTING)


def test_both_lines_readings_and_the_loop_are_drawn(figure):
    left, right = figure.axes[:2]
    drawn = [np.asarray(line.get_xydata()) for line in left.lines]
    assert [len(points) for points in drawn] == [9, 2, 8, 2]
    np.testing.assert_allclose(drawn[1], [[2, 3.9], [18, 27.9]])
    # The unloading line reaches back to the greatest load, which is on it.
    np.testing.assert_allclose(drawn[3], [[2, 2.64], [18, 26.96]])
    law = next(line for line in right.lines if len(line.get_xydata()) == 5)
    np.testing.assert_allclose(np.asarray(law.get_ydata()), [0.6, 0.6, -0.6, -0.6, -0.6 + 1.2], atol=1e-9)
    low, high = right.get_ylim()
    assert -1.5 < low < -0.6 < 0.6 < high < 1.5


def test_units_places_and_origin_are_said_and_all_stays_on_the_page(figure):
    texts = "\n".join(said(figure))
    for factor_table in (
        *("displacement (mm)", "force (kN)", "force less k d + C (kN)", "as on flat ground", "simulated, not measured"),
        *("k loading 1.500, unloading 1.520 kN/mm", "19.2 J a cycle over 17 mm at the wheel centre"),
        *("x - k beta 0.6 ± 0.01 kN", "x, 95 % interval", "envelopes, ± x"),
    ):
        assert factor_table in texts
    assert sticking_out(figure) == []


def test_a_case_without_a_law_says_so_and_what_is_left_out_is_counted():
    without = panel(k_unloading_kN_per_mm=np.nan)._replace(loop=None)
    figure = load_deflection_loops([without] * 10, SETTING, "as given")
    texts = "\n".join(said(figure))
    assert "see status" in texts
    assert "The first 8 of 10 cases." in texts
    assert "Displacement and force as given" in texts
    assert "k loading 1.500 kN/mm" in texts
