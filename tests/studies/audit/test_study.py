"""The audit: its grid, its truths, the tidy table of made-up answers, and a sentence for each outcome."""

import numpy as np
import pytest
from helpers.audit_made_up import RIG, SMALL, audited, blind, right

from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.steps import find_step
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.studies.audit.grid import FACTORS, PLANS, SOURCE_WINDOW, TYPICAL, Tyre, truth_of
from bayes_tyre.studies.audit.methods import AMPLITUDE_MM, energy_J, motion_values
from bayes_tyre.studies.audit.overview import beta_response, coverage_verdict, factor_effects, overview
from bayes_tyre.studies.audit.sentences import conclusion, lines
from bayes_tyre.studies.audit.study import COLUMNS, count_records

pytestmark = pytest.mark.usefixtures("fully_compiled")

PUBLISHED = [0.019, 0.02, 0.021, 0.5]


@pytest.mark.parametrize("name", PLANS)
def test_every_truth_of_a_plan_stands_once_and_loses_energy(name):
    plan = PLANS[name]
    tyres = plan.tyres()
    assert len(set(tyres)) == len(tyres)
    assert TYPICAL in tyres
    assert all(tyre.x_kN > 1.5 * tyre.k_kN_per_mm * tyre.beta_mm for tyre in tyres)
    for factor, factors in (*plan.alone.items(), *plan.crossed.items()):
        others = {tyre for tyre in tyres if tyre._replace(**{factor: getattr(TYPICAL, factor)}) == TYPICAL}
        assert {getattr(tyre, factor) for tyre in others} >= set(factors)
    crossed = [tyre for tyre in tyres if len(plan.windows_of(tyre)) > 1]
    assert len(crossed) == np.prod([len(factors) for factors in plan.crossed.values()])
    assert all(SOURCE_WINDOW in plan.windows_of(tyre) for tyre in tyres)
    assert count_records(plan, 3) == 3 * len(tyres)


def test_a_truth_is_what_its_point_says_and_its_axle_belongs_to_the_replicate():
    other = Tyre(k_kN_per_mm=2.5, x_kN=0.7, beta_mm=0.16, damping_ratio=0.1, rise_s=0.06)
    one, two, third = (truth_of(*at, RIG, 5) for at in ((TYPICAL, 1), (other, 1), (TYPICAL, 2)))
    assert (two.k_kN_per_mm, two.x_kN, two.beta_mm, two.rise_time_s) == (2.5, 0.7, 0.16, 0.06)
    assert one.m_kg == two.m_kg != third.m_kg
    assert one.load_before_kN == two.load_before_kN
    assert one.seed != two.seed
    assert truth_of(TYPICAL, 1, RIG, 5) == one
    # Critical damping goes with the root of k; the simulator's own truths have 0.02 to 0.04 of it.
    assert two.c_kN_s_per_mm / one.c_kN_s_per_mm == pytest.approx(0.1 / 0.03 * np.sqrt(2.5 / 1.8))
    rests = [truth.rest_friction_kN / (truth.x_kN - truth.k_kN_per_mm * truth.beta_mm) for truth in (one, two)]
    assert rests[0] == pytest.approx(rests[1])
    step = find_step(find_channels(simulate_record(one, RIG).raw, RIG))
    assert step.change_kN == pytest.approx(TYPICAL.step_kN, rel=0.05)


def test_the_table_counts_bias_error_coverage_and_those_declined():
    def rule(method, parameter, tyre, window, n):
        return {1: 1.1, 2: 1.3, 3: None}[n]

    # Intervals of 10 % hold the truth where the value is 10 % too high, 0.99 to 1.21, and not where it is 30 %.
    found = audited(rule, replicates=3, half_width=0.1)
    table = found.table
    assert tuple(table.columns) == COLUMNS
    assert not table.duplicated([*FACTORS, "method", "parameter"]).any()
    np.testing.assert_allclose(table["bias_percent"], 20.0)
    np.testing.assert_allclose(table["median"], 1.2 * table["truth"])
    np.testing.assert_allclose(table["rmse_percent"], 100 * np.sqrt((0.1**2 + 0.3**2) / 2))
    np.testing.assert_allclose(table["coverage_95"], 0.5)
    assert (table[["intervals", "returned", "declined", "doubted"]] == [2, 2, 1, 0]).all(axis=None)
    assert table["window_samples"].isna().tolist() == (table["method"] != "thesis").tolist()
    assert set(found.records.loc[found.records["value"].isna(), "status"]) == {"declined"}
    shown = overview(table).set_index(["method", "parameter"])
    assert shown.loc[("motion", "k"), "declined"] == len(SMALL.tyres())
    assert shown.loc[("motion", "k"), "coverage_95"] == 0.5
    assert any("declined" in line for line in conclusion(table, PUBLISHED))


def test_a_method_that_declines_everything_is_said_to():
    found = audited(lambda method, *_: None if method == "thesis" else 1.0)
    said = "\n".join(conclusion(found.table, PUBLISHED))
    assert "beta by `thesis`: too few points" in said
    assert "published" not in said
    assert len(lines(overview(found.table))) == 1 + 10


def test_a_method_that_is_blind_to_beta_is_told_from_one_that_finds_it():
    table = audited(blind).table
    found = beta_response(table, "thesis")
    assert found is not None
    assert found.returned == pytest.approx((0.02, 0.02 * 0.06 / 0.036))
    assert found.true == (0.04, 0.12)
    assert found.share == pytest.approx(0.0, abs=1e-12)
    motion = beta_response(table, "motion")
    assert motion is not None
    assert motion.rank_correlation == 1.0
    assert abs(found.rank_correlation) < 0.5
    effects = factor_effects(table, "thesis")
    ratios = {name: effect.ratio for name, effect in effects.items()}
    assert ratios == pytest.approx({"beta_mm": 1.0, "rise_s": 0.06 / 0.036, "window_samples": 3.0})
    said = "\n".join(conclusion(table, PUBLISHED))
    assert "0.02 to 0.0333 mm is returned where the truth is 0.04 to 0.12 mm" in said
    assert "it says little about the tyre" in said
    assert "the window moves it more than the tyre does" in said
    assert "2 of 4 lie within" in said
    assert "cannot say is which beta the tyre has" in said
    assert "no statement of what happened on the rig" in said
    assert said.count("it is a property of the tyre") == 2  # inertia, motion
    assert "How much the axle rings is part of it" in said


def test_a_method_that_finds_beta_is_said_to_and_one_that_is_off_is_not():
    said = "\n".join(conclusion(audited(right).table, PUBLISHED))
    assert said.count("it is a property of the tyre") == 3
    assert "the tyre moves it most" in said
    assert "can be read as the tyre's beta" in said
    assert "little about the tyre" not in said
    half = audited(lambda method, parameter, tyre, *_: (tyre.beta_mm / 0.1) ** -0.5 if parameter == "beta" else 1.0)
    said = "\n".join(conclusion(half.table, PUBLISHED))
    assert said.count("follows the tyre, and is off all the same") == 3
    assert "They can order tyres" in said


def test_the_words_of_a_coverage_follow_its_count():
    # Exact binomial 95 % intervals: 80 of 100 has 71 to 87 %, 95 of 100 89 to 98 %, 200 of 200 98.2 to 100 %.
    counts = ((80, 100), (95, 100), (200, 200), (0, 0))
    assert [coverage_verdict(*count) for count in counts] == [
        "too narrow",
        "agrees with 95 %",
        "too wide",
        "no intervals",
    ]


def test_the_energy_of_a_motion_is_that_of_its_parameters_and_its_interval_that_of_draws():
    logs = np.log([1.8, 0.45, 0.08, 290.0, 1e-3])
    covariance = np.diag([4e-3, 1e-2, 8e-3, 0.05, 0.1]) ** 2
    value, lower, upper = motion_values(logs, covariance, "", TYPICAL, RIG).values["energy_per_cycle"]
    assert value == pytest.approx(energy_J(RIG, TYPICAL, 1.8, 0.45, 0.08))
    # 4 (x - k beta) (a - beta) of the law on flat ground, where stroke and force differ from the wheel centre's.
    assert value == pytest.approx(4 * (0.45 - 1.8 * 0.08) * (AMPLITUDE_MM - 0.08), rel=0.15)
    draws = np.exp(logs[:3] + np.random.default_rng(0).standard_normal((2000, 3)) * np.sqrt(np.diag(covariance)[:3]))
    by_draws = np.std(np.log([energy_J(RIG, TYPICAL, k, x, beta) for k, x, beta in draws]))
    # The standard deviation of 2000 draws has a relative error of 1.6 %: four of them, and 1 % for the curvature.
    assert np.log(upper / lower) / (2 * 1.959964) == pytest.approx(by_draws, rel=0.075)
    assert motion_values(np.full(5, np.nan), covariance, "lost", TYPICAL, RIG).values == {}


def test_energy_is_made_where_k_beta_exceeds_the_friction():
    assert energy_J(RIG, TYPICAL, 1.8, 0.1, 0.08) < 0
