"""Cycles of driven curves whose laws are given, not fitted: areas, energies by hand, drift, backbone, status."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from bayes_tyre.inference.least_squares.loops import backbone, cycle_table, law_curves

K, BETA = 1.5, 0.4


def force(d, d_i: float, F_i: float, C: float):
    """Equation 2 in numpy."""
    return F_i + (K * d + C - F_i) * -np.expm1(-np.abs(d - d_i) / BETA)


def cycle(number: int, high: float, C: float, points: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the two branches of a cycle between 0 and `high` (mm) on Equation 2, C below and above zero, and fits."""
    branches, fits, F_i = [], [], -0.7
    for i, (direction, start, end, offset) in enumerate([("loading", 0.0, high, C), ("unloading", high, 0.0, -C)]):
        d = np.linspace(start, end, points)
        name = {"record": f"a {2 * number + i - 1}", "loop": "a", "branch": 2 * number + i - 1, "cycle": number}
        F = force(d, start, F_i, offset)
        branches.append(pd.DataFrame({"displacement_mm": d, "force_kN": F, "direction": direction, **name}))
        values = {"k_kN_per_mm": K, "C_kN": offset, "beta_mm": BETA, "d_i_mm": start, "F_i_kN": F_i}
        fits.append({**name, **values, "direction": direction, "status": "ok", "origin": "simulated"})
        F_i = F[-1]
    return pd.concat(branches), pd.DataFrame(fits)


@pytest.fixture
def driven() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return two cycles, with an open branch before and behind them."""
    (one, fits_one), (two, fits_two) = cycle(1, 5.0, 0.8, 4001), cycle(2, 5.0, 0.6, 3001)
    before, behind = (one.head(9).assign(record=f"a {at}", cycle=0) for at in (0, 5))
    open_fits = [fits_one.head(1).assign(record=f"a {at}", cycle=0, status="too few") for at in (0, 5)]
    fits = [open_fits[0], fits_one, fits_two, open_fits[1]]
    return pd.concat([before, one, two, behind], ignore_index=True), pd.concat(fits, ignore_index=True)


def shoelace(d: np.ndarray, F: np.ndarray) -> float:
    """Return the area that a polygon encloses, positive clockwise."""
    return 0.5 * float(np.sum(np.roll(d, -1) * F - d * np.roll(F, -1)))


def test_areas_are_those_of_polygon_and_of_the_law(driven):
    branches, fits = driven
    cycles = cycle_table(branches, fits, backbone(branches))
    assert list(zip(cycles["record"], cycles["cycle"], cycles["branches"], strict=True)) == [
        ("a", 1, "1-2"),
        ("a", 2, "3-4"),
    ]
    for row in cycles.to_dict("records"):
        points = branches[branches["cycle"] == row["cycle"]]
        d, F = points["displacement_mm"].to_numpy(), points["force_kN"].to_numpy()
        assert row["energy_J"] == pytest.approx(shoelace(d, F), rel=1e-12)
        pair = fits[fits["cycle"] == row["cycle"]].to_dict("records")
        up, down = (
            quad(force, *ends, args=(fit["d_i_mm"], fit["F_i_kN"], fit["C_kN"]))[0]
            for fit, ends in zip(pair, ((0, 5), (5, 0)), strict=True)
        )
        assert row["law_energy_J"] == pytest.approx(up + down, rel=1e-4)
        assert row["energy_difference_J"] == row["law_energy_J"] - row["energy_J"]
        assert abs(row["energy_difference_J"]) < 1e-3 * row["energy_J"]  # the points are dense
        assert (row["points"], row["travel_mm"], row["closing_mm"]) == (len(points) - 1, 5.0, 0.0)
        assert row["force_range_kN"] == np.ptp(F)
        assert row["k_secant_kN_per_mm"] == (F[d.argmax()] - F[d.argmin()]) / 5.0


def test_energy_and_mean_force_drift_against_the_first_cycle(driven):
    branches, fits = driven
    branches["force_kN"] += np.where(branches["cycle"] == 2, 0.25, 0.0)
    curves = backbone(branches)
    cycles = cycle_table(branches, fits, curves)
    assert list(cycles["energy_drift"]) == [0.0, cycles["energy_J"][1] / cycles["energy_J"][0] - 1.0]
    assert cycles["mean_force_drift_kN"][0] == 0.0
    one, two = (curves[curves["cycle"] == number]["backbone_kN"].mean() for number in (1, 2))
    assert cycles["mean_force_drift_kN"][1] == pytest.approx(two - one)


def test_the_backbone_is_the_mean_of_both_forces_at_equal_displacement(driven):
    branches, _ = driven
    curve = backbone(branches)
    assert list(curve.groupby("cycle").size()) == [101, 101]
    first = curve[curve["cycle"] == 1]
    d = first["displacement_mm"].to_numpy()
    assert (d[0], d[-1]) == (0.0, 5.0)
    loading = force(d, 0.0, -0.7, 0.8)
    np.testing.assert_allclose(first["loading_kN"], loading, atol=1e-6)
    unloading = force(d, 5.0, loading[-1], -0.8)
    np.testing.assert_allclose(first["backbone_kN"], (loading + unloading) / 2, atol=1e-6)


def test_a_branch_that_is_not_ok_is_named_and_one_without_a_law_has_no_energy_of_it(driven):
    branches, fits = driven
    values = ["k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN"]
    bad = (fits["cycle"] == 2) & (fits["direction"] == "unloading")
    fits.loc[bad, "status"] = "the curve is not Equation 2"
    fits.loc[bad, values] = np.nan
    cycles = cycle_table(branches, fits, backbone(branches))
    assert list(cycles["status"]) == ["ok", "unloading: the curve is not Equation 2"]
    assert list(cycles["law_energy_J"].isna()) == [False, True]
    assert cycles["energy_J"].notna().all()


def test_without_a_closed_cycle_the_tables_have_their_columns_and_no_rows(driven):
    branches, fits = (table[table["cycle"] == 0].reset_index(drop=True) for table in driven)
    curves = backbone(branches)
    assert (len(curves), "backbone_kN" in curves) == (0, True)
    cycles = cycle_table(branches, fits, curves)
    assert (len(cycles), "energy_J" in cycles) == (0, True)
    assert law_curves(branches, fits).shape == (2, 400, 2)
