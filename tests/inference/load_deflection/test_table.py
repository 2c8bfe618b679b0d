"""Lines and law through slow tests of known truth, drawn in numpy: recovery, coverage, what is not determined."""

import re

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.slow_tests import Tyre, on_flat_ground, path
from scipy import stats

from bayes_tyre.inference.load_deflection.cycle_fit import Cycle, estimate_cycles
from bayes_tyre.inference.load_deflection.table import fit_tests, law_loop, straight_line
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.signals.load_deflection import check_load_deflection, with_deflection

# Compilation: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

#: Readings 0.042 mm apart.
DENSE = path(high_mm=10.0, steps=200)


def placed(*tests: pd.DataFrame) -> pd.DataFrame:
    table = pd.concat([test.assign(test=f"test {i}") for i, test in enumerate(tests)], ignore_index=True)
    return with_deflection(check_load_deflection(table), {"": None})


def fitted(*tests: pd.DataFrame, beta_mm: float | None = None) -> pd.DataFrame:
    return fit_tests(placed(*tests), beta_mm)


@pytest.fixture(scope="module")
def sparse() -> pd.DataFrame:
    """Return fits of readings some 2.3 mm apart: without noise, with it, without friction, and falling."""
    upright = on_flat_ground(Tyre(), 0.05, 1)
    bent = on_flat_ground(Tyre(), 0.02, 3)
    bent["load_kN"] += 0.02 * bent["displacement_mm"] ** 2
    return fitted(
        on_flat_ground(Tyre()),
        upright,
        on_flat_ground(Tyre(x=0.0, beta=1e-9), 0.05, 3),
        upright.assign(displacement_mm=lambda t: -t["displacement_mm"]),
        bent,
    )


def test_the_simulated_readings_are_those_of_the_package_s_law():
    tyre = Tyre(beta=0.4)
    law = Fancher(k=tyre.k, C=tyre.C, x=tyre.x, beta=tyre.beta)
    d = path(steps=20)
    start = tyre.k * d[0] + tyre.C + tyre.settled
    np.testing.assert_allclose(tyre.force(d), law.force(jnp.asarray(d), start), rtol=1e-12)


def test_lines_and_their_errors_are_those_of_the_textbook():
    d, F = np.random.default_rng(0).normal(size=(2, 9))
    line = straight_line(d, F)
    (k, C), covariance = np.polyfit(d, F, 1, cov=True)
    found = line.k, line.C, line.k_se, line.C_se
    np.testing.assert_allclose(found, (k, C, *np.sqrt(np.diag(covariance))), rtol=1e-9)
    assert line.rmse == pytest.approx(np.sqrt(((F - k * d - C) ** 2).mean()))
    assert np.isnan(straight_line(d[:2], F[:2]).k_se)
    assert np.isnan(straight_line(np.ones(5), F[:5]).k)


def test_exact_readings_far_apart_return_k_C_and_the_settled_half_width(sparse):
    row, tyre = sparse.iloc[0], Tyre()
    found = row[["k_kN_per_mm", "C_kN", "x_less_k_beta_kN"]].to_numpy(float)
    np.testing.assert_allclose(found, (tyre.k, tyre.C, tyre.settled), rtol=1e-9)
    assert row["k_loading_kN_per_mm"] == pytest.approx(tyre.k, rel=1e-9)
    # The greatest load is on both lines, and on the loading branch: 4 steps from the middle of 9 even ones, it takes
    # the slope up by 2 (x - k beta) 4 / (60 steps).
    step = (20.0 - 1.7) / 8
    assert row["k_unloading_kN_per_mm"] == pytest.approx(tyre.k + 2 * tyre.settled * 4 / (60 * step), rel=1e-6)
    a = (20.0 - 1.7) / 2
    assert row["energy_per_cycle_J"] == pytest.approx(4 * tyre.settled * a, rel=1e-3)
    # The polygon of the readings cuts the corner at the turn: half a step of the 8.
    assert row["loop_area_J"] == pytest.approx(4 * tyre.settled * a * (1 - 1 / 16), rel=1e-6)


def test_readings_far_apart_say_that_beta_and_x_stay_unknown(sparse):
    row = sparse.iloc[1]
    assert "beta not determined: only an upper bound" in row["status"]
    assert "2.3 mm apart" in row["status"]
    assert row[["x_kN", "beta_mm"]].isna().all()
    assert row["x_low_kN"] < Tyre().x < row["x_high_kN"]
    assert Tyre().beta < row["beta_high_mm"] < 2.3
    assert row["rmse_kN"] == pytest.approx(0.05, rel=0.5)


def test_no_friction_a_wrong_sign_and_bent_envelopes_are_said(sparse):
    assert "no friction seen" in sparse.loc[2, "status"]
    assert sparse.loc[2, "x_less_k_beta_kN"] == 0
    assert np.isnan(sparse.loc[2, "x_less_k_beta_kN_se"])
    assert "check the signs" in sparse.loc[3, "status"]
    # k grows from 2 x 0.02 x 1.7 to 2 x 0.02 x 20: by 0.732 kN/mm; its error is 0.009.
    grows = re.search(r"the envelopes bend: k grows by (\S+) kN/mm", sparse.loc[4, "status"])
    assert grows is not None
    assert float(grows[1]) == pytest.approx(0.732, abs=0.04)
    assert "bend" not in sparse.loc[1, "status"]


def test_dense_readings_return_x_and_beta_within_their_errors():
    tyres = [Tyre(), Tyre(k=1.9, C=-0.4, x=1.2, beta=0.15)]
    rows = fitted(*(on_flat_ground(tyre, 0.05, i, DENSE) for i, tyre in enumerate(tyres)))
    assert rows["status"].tolist() == ["ok", "ok"]
    for (_, row), tyre in zip(rows.iterrows(), tyres, strict=True):
        truth = {"k_kN_per_mm": tyre.k, "C_kN": tyre.C, "x_kN": tyre.x, "beta_mm": tyre.beta}
        for column, value in truth.items():
            # Eight numbers beyond four standard errors: one seed in two thousand.
            assert abs(row[column] - value) < 4 * row[f"{column}_se"]
            assert row[f"{column}_se"] < 0.25 * abs(value)
        assert row["beta_mm_se"] < row["beta_high_mm"] - row["beta_mm"] < 3 * row["beta_mm_se"]


def test_a_beta_from_elsewhere_gives_x_and_none_that_makes_energy_is_ever_found():
    test = on_flat_ground(Tyre(), 0.05, 5)
    row = fitted(test, beta_mm=0.05).iloc[0]
    assert row["status"] == "ok"
    assert row["beta_mm"] == pytest.approx(0.05)
    assert np.isnan(row["beta_mm_se"])
    assert abs(row["x_kN"] - Tyre().x) < 4 * row["x_kN_se"]
    for beta_mm in (1000.0, 1e300):
        assert "mm is above half the stroke, " in fitted(test, beta_mm=beta_mm).iloc[0]["status"]
    # A loop run through the wrong way would make energy: the bound holds, and the status says so.
    wrong = test.assign(load_kN=lambda t: 2 * (1.5 * t["displacement_mm"] + 0.3) - t["load_kN"])
    row = fitted(wrong).iloc[0]
    assert row["x_less_k_beta_kN"] == 0
    assert row["energy_per_cycle_J"] == pytest.approx(0, abs=1e-9)
    assert row["loop_area_J"] < 0
    assert "no friction seen" in row["status"]


def test_intervals_cover_the_truth_as_often_as_they_say():
    tests, tyre, d = 400, Tyre(), path()
    noise = 0.1 * np.random.default_rng(11).normal(size=(tests, len(d)))
    n = len(d)
    cycles = Cycle(
        d=jnp.tile(d, (tests, 1)),
        F=jnp.asarray(tyre.force(d) + noise),
        used=jnp.ones((tests, n), bool),
        start=jnp.ones(tests),
        betas=jnp.tile(np.geomspace(0.002, 18.3, 100), (tests, 1)),
        rise=jnp.full(tests, stats.f.ppf(0.95, 1, n - 4)),
        refuted=jnp.full(tests, stats.f.ppf(0.999, 1, n - 4)),
    )
    found = estimate_cycles(cycles)
    assert found.converged.all()
    # A thousandth of the tests refutes a small beta by chance, and few of those with a beta that two readings show:
    # more than 2 of 400 has a probability below 1e-2.
    assert found.open_below.mean() >= 398 / 400
    truth = np.array([tyre.k, tyre.C, tyre.settled])
    off = np.abs(np.asarray(found.value)[:, :3] - truth) / np.asarray(found.standard_error)[:, :3]
    cover = (off < stats.t.ppf(0.975, n - 4)).mean(axis=0)
    # Three parameters are fitted where four are counted, so 95 % and a little: 0.957. Of 400, less than 0.92 or more
    # than 0.99 has a probability of 1e-3 each.
    assert ((cover > 0.92) & (cover < 0.99)).all()
    # beta is 0.05 mm and x 0.7 kN: both within the bounds in all but one of twenty at most.
    assert (np.asarray(found.beta_range)[:, 1] > tyre.beta).mean() > 0.95
    assert (np.asarray(found.x_range)[:, 1] > tyre.x).mean() > 0.95


def test_ragged_tests_are_fitted_as_each_would_be_alone():
    tests = [on_flat_ground(Tyre(), 0.05, 1), on_flat_ground(Tyre(), 0.05, 2, path(steps=5))]
    together = fitted(*tests)
    alone = pd.concat([fitted(test) for test in tests], ignore_index=True)
    pd.testing.assert_frame_equal(together.drop(columns="test"), alone.drop(columns="test"), rtol=1e-6)


def test_a_test_that_allows_no_law_keeps_its_line_and_says_why():
    cycle = on_flat_ground(Tyre())
    rows = fitted(cycle.iloc[:9], cycle.iloc[9:], cycle.iloc[[0, 8, 16]])
    first, last = rows.iloc[0], rows.iloc[2]
    assert first["status"] == "only loading readings: friction shows between loading and unloading alone"
    assert first["k_loading_kN_per_mm"] == pytest.approx(1.5)
    empty = ["k_unloading_kN_per_mm", "k_kN_per_mm", "loop_area_J", "energy_per_cycle_J"]
    assert first[empty].isna().all()
    assert "too few readings: 3 for 4 parameters" in last["status"]
    assert last["loop_area_J"] > 0
    # With beta given there are three parameters, and four readings will do.
    four = cycle.iloc[[0, 5, 10, 14]]
    assert "too few readings: 4 for 4 parameters" in fitted(four).iloc[0]["status"]
    assert "too few readings" not in fitted(four, beta_mm=0.05).iloc[0]["status"]


def test_the_loop_of_the_law_closes_and_has_its_energy():
    row = {"k_kN_per_mm": 1.5, "C_kN": 0.3, "x_less_k_beta_kN": 0.6, "beta_mm": 0.1}
    d, F = law_loop(row, 2.0, 18.0, 2000).T
    area = float(((F + np.roll(F, -1)) * (np.roll(d, -1) - d)).sum() / 2)
    assert area == pytest.approx(4 * 0.6 * (8 - 0.1), rel=1e-3)
    assert abs(F[0] - F[-1]) < 1e-6


def test_a_cycle_behind_another_begins_on_the_unloading_curve():
    tyre = Tyre(beta=0.4)
    curve = on_flat_ground(tyre, d=np.concatenate([DENSE, DENSE[1:]]))
    both = fitted(curve)
    assert both["test"].tolist() == ["test 0, cycle 1", "test 0, cycle 2"]
    np.testing.assert_allclose(both[["x_kN", "beta_mm"]], [[tyre.x, tyre.beta]] * 2, rtol=1e-6)
    assert (both["status"] == "ok").all()
