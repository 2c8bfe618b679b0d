"""Records of known truth: each kind's table is sound, follows its law, and has the fault that it names."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from bayes_tyre.laws.fancher import equation_2_offset, small_step_limit_offset
from bayes_tyre.record_table import check_record_table
from bayes_tyre.studies.coverage_data import KINDS, NEAR_START_MM, STEP_KN, TRAVEL_MM, Kind, simulate

NOISELESS = Kind(sigma_kN=0.0)


def arrays(kind: Kind, number: int = 0):
    """Return displacement and force, shape (records, points), and the truth."""
    table, truth = simulate(kind, 0, number)
    shape = len(truth), kind.points
    return (table[name].to_numpy().reshape(shape) for name in ("displacement_mm", "force_kN")), truth


def noise_of(kind: Kind, sets: int = 10):
    """Return noise of the force and distance from the start, shape (records of all sets, points)."""
    both = []
    for number in range(sets):
        (_, force), _ = arrays(kind, number)
        (displacement, noiseless), _ = arrays(replace(kind, sigma_kN=0.0), number)
        both.append((force - noiseless, np.abs(displacement - displacement[:, :1])))
    return (np.concatenate(parts) for parts in zip(*both, strict=True))


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_a_sound_record_table_and_the_same_each_time(name):
    table, truth = simulate(KINDS[name], 3, 1)
    checked = check_record_table(table)
    fitted = truth["speed_km_h"] != KINDS[name].held_out_km_h
    assert set(checked["record"]) == set(truth["record"][fitted])
    assert truth["record"].is_unique
    assert (table.groupby("record").size() == KINDS[name].points + KINDS[name].rest_points).all()
    assert (truth.groupby("case").size() == KINDS[name].repeats).all()
    assert truth["case"][fitted].nunique() * KINDS[name].repeats in (24, 48)
    again, _ = simulate(KINDS[name], 3, 1)
    assert table.equals(again)
    assert not table.equals(simulate(KINDS[name], 3, 2)[0])


@pytest.mark.parametrize(
    ("limit", "offset"), [(False, equation_2_offset), (True, small_step_limit_offset)], ids=["equation 2", "limit"]
)
def test_forces_follow_the_law_of_their_truth(limit, offset):
    (displacement, force), truth = arrays(replace(NOISELESS, small_step_limit=limit))
    k, J, beta, F_i = (truth[name].to_numpy()[:, None] for name in ("k", "J", "beta", "F_i"))
    expected = F_i + np.asarray(offset(displacement - displacement[:, :1], k=k, J=J, beta=beta))
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-9)
    assert (np.sign(truth["step_kN"]) == np.sign(J[:, 0])).all()
    assert (truth["step_kN"].abs() == STEP_KN).all()


def test_noise_with_heavy_tails_is_a_student_t():
    noise, _ = noise_of(KINDS["heavy_tailed_noise"])
    # 9,600 numbers: further from SciPy's distribution than chance lets one of 1,000 samples be.
    assert stats.kstest(np.ravel(noise) / KINDS["heavy_tailed_noise"].sigma_kN, stats.t(3.0).cdf).pvalue > 1e-3


def test_a_fault_leaves_the_truths_as_they_are():
    truth = simulate(Kind(), 0, 5)[1]
    for fault in (Kind(rho=0.35), Kind(noise_near_start=3.0), Kind(displacement_noise_mm=0.01)):
        assert truth.equals(simulate(fault, 0, 5)[1])


def test_a_hardening_record_ends_where_its_mean_stiffness_says():
    (_, hardening), truth = arrays(Kind(sigma_kN=0.0, hardening_per_mm=0.02))
    (_, even), same = arrays(NOISELESS)
    assert truth.equals(same)
    np.testing.assert_allclose(hardening[:, -1], even[:, -1])
    # In the middle, k u (h / 2) (L - u) / (1 + h L / 2) below: 2.5 mm, 0.02 / mm, 5 mm.
    points = replace(NOISELESS, points=41)
    (_, even), truth = arrays(points)
    (_, hardening), _ = arrays(replace(points, hardening_per_mm=0.02))
    below = np.abs(even - hardening)[:, 20] / truth["k"].to_numpy()
    np.testing.assert_allclose(below, 2.5 * 0.01 * 2.5 / 1.05, rtol=1e-6)


def test_readings_are_multiples_of_their_step_and_displacement_noise_has_its_size():
    (rounded, _), _ = arrays(KINDS["displacement_steps"])
    steps = rounded / 0.0126
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    (noisy, _), _ = arrays(replace(KINDS["displacement_noise"], displacement_noise_mm=0.01))
    (exact, _), _ = arrays(replace(KINDS["displacement_noise"], displacement_noise_mm=0.0))
    # 960 normal numbers: a standard deviation to 2.3 %; four standard errors, false alarm 1e-4.
    assert np.std(noisy - exact) == pytest.approx(0.01, rel=0.1)
    assert np.abs(exact[:, -1] - exact[:, 0]) == pytest.approx(TRAVEL_MM)


def test_noise_is_as_large_and_as_correlated_as_its_kind_says():
    # 240 records of 40 points: r_1 has a standard error of 0.01, the size one of 0.72 % (of correlated noise 0.8 %),
    # the ratio one of 1.6 %. Four of each are allowed: a false alarm in one of 3,000.
    noise, _ = noise_of(Kind())
    assert np.std(noise) == pytest.approx(0.03, rel=0.03)
    assert np.mean(noise[:, 1:] * noise[:, :-1]) / np.mean(noise**2) == pytest.approx(0.0, abs=0.04)
    correlated, _ = noise_of(KINDS["correlated_noise"])
    assert np.std(correlated) == pytest.approx(0.03, rel=0.033)
    assert np.mean(correlated[:, 1:] * correlated[:, :-1]) / np.mean(correlated**2) == pytest.approx(0.35, abs=0.04)
    uneven, far = noise_of(KINDS["uneven_noise"])
    near = far < NEAR_START_MM
    assert np.std(uneven[near]) / np.std(uneven[~near]) == pytest.approx(3.0, rel=0.064)


def test_repeats_scatter_normally_or_with_heavy_tails():
    def scatter(kind: Kind) -> np.ndarray:
        truths = [simulate(kind, 1, number)[1] for number in range(25)]
        return np.concatenate([np.log(truth["k"] / truth["k_case"]) / 0.04 for truth in truths])

    # 600 repeats: 0.04 of normal ones are beyond four standard deviations, 17 of t(3); either side fails in 1 of 1000.
    assert np.sum(np.abs(scatter(Kind())) > 4.0) <= 1
    assert np.sum(np.abs(scatter(KINDS["heavy_tailed_repeats"])) > 4.0) >= 6


def test_repeats_take_turns_on_the_tyres_of_a_configuration():
    several, one = (simulate(kind, 0, 0)[1] for kind in (KINDS["several_tyres"], Kind()))
    apart = pd.Series(np.log(several["k"] / one["k"]))
    of_tyre = apart.groupby([several["configuration"], several["tyre"]]).agg(["mean", "std"])
    assert len(of_tyre) == 6
    assert of_tyre["std"].max() < 1e-12
    # The standard deviation of six of 6 % is between 2.2 and 10.6 % in all but 1 of 100 seeds.
    assert 0.02 < of_tyre["mean"].std() < 0.11
    pd.testing.assert_series_equal(several["k_case"], one["k_case"])


def test_the_case_apart_is_the_last_one():
    kind = KINDS["case_apart"]
    apart, same = (simulate(one, 0, 0)[1].drop_duplicates("case") for one in (kind, replace(kind, case_apart=1.0)))
    ratio = (apart["k_case"] / same["k_case"]).to_numpy()
    assert ratio[-1] == pytest.approx(1.25)
    np.testing.assert_array_equal(ratio[:-1], 1.0)
    assert apart["case"].iloc[-1] == "dual (35)20-10"


def test_effects_of_speed_lie_on_a_line_where_a_kind_says_so():
    """Of two cases that differ in speed alone, but for remainders that are taken off by their mean over many sets."""
    kind = replace(KINDS["untested_speed_beyond"], repeats=1)
    bends = {True: [], False: []}
    for number in range(200):
        for trend in bends:
            cases = simulate(replace(kind, speed_trend=trend), 0, number)[1]
            by_speed = cases.assign(log_k=np.log(cases["k_case"])).groupby("speed_km_h")["log_k"].mean()
            bends[trend].append(by_speed[35.0] - by_speed[25.0] - 10.0 / 15.0 * (by_speed[50.0] - by_speed[35.0]))
    # Means of four remainders of 0.04 have 0.02, levels without a line 0.06: sqrt(1 + (5/3)^2 + (2/3)^2) times that.
    assert np.std(bends[True]) == pytest.approx(0.02 * np.sqrt(1 + 25 / 9 + 4 / 9), rel=0.2)
    assert np.std(bends[False]) == pytest.approx(np.hypot(0.02, 0.06) * np.sqrt(1 + 25 / 9 + 4 / 9), rel=0.2)
