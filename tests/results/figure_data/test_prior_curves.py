"""Prior records start and travel as typical records of the data do."""

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import posterior, scattered
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.model.prior_predictive import draw_prior
from bayes_tyre.record_table import record_factors
from bayes_tyre.results.figure_data import prior_curves
from bayes_tyre.results.figure_data.prior_curves import DRAWN, PANELS, POINTS, REAL, PriorPanel, prior_panels

CAMPAIGN = Plan(speeds=(0.0,), points=40)


def panels_of(table: pd.DataFrame, **settings) -> list[PriorPanel]:
    factor_table = record_factors(table)
    return prior_panels(posterior(scattered(factor_table, seed=31), factor_table), table, **settings)


def test_each_configuration_and_direction_has_a_panel_that_starts_and_travels_like_one_of_its_records():
    table, _ = simulate(CAMPAIGN, 1)
    found = panels_of(table)
    directions = ("loading", "unloading")
    assert [(p.configuration, p.direction) for p in found] == [(c, d) for c in ("dual", "single") for d in directions]
    for panel in found:
        mine = table[table["record"] == panel.like]
        d = mine["displacement_mm"].to_numpy()
        assert set(mine["configuration"]) == {panel.configuration}
        for _, curve in panel.curves.groupby("record"):
            assert len(curve) == POINTS
            np.testing.assert_allclose(curve["displacement_mm"].iloc[[0, -1]], [d[0], d[np.argmax(np.abs(d - d[0]))]])
        assert panel.curves["record"].nunique() == DRAWN
        np.testing.assert_array_equal(panel.band["displacement_mm"], panel.curves["displacement_mm"][:POINTS])
        assert (panel.band["lower_kN"] < panel.band["upper_kN"]).all()


def test_the_record_is_the_one_of_median_travel_and_the_data_are_of_its_case():
    table, _ = simulate(Plan(configurations=("a",), speeds=(0.0, 20.0), loads=(20.0,), steps=(10.0,), points=40), 2)
    names = list(dict.fromkeys(table["record"]))
    first = table.groupby("record")["displacement_mm"].transform("first")
    stretch = table["record"].map(dict(zip(names, (1.0, 5.0, 2.0, 3.0, 9.0, 4.0), strict=True)))
    (panel,) = panels_of(table.assign(displacement_mm=first + (table["displacement_mm"] - first) * stretch))
    assert panel.like == names[3]
    assert set(panel.points["record"]) == set(names[3:])


def test_bands_hold_the_stated_share_of_the_prior_records():
    table, _ = simulate(CAMPAIGN, 3)
    for panel in panels_of(table, interval=0.5):
        inside = panel.curves["force_kN"].between(
            np.tile(panel.band["lower_kN"], DRAWN), np.tile(panel.band["upper_kN"], DRAWN)
        )
        # Points of a record hang together: 40 independent records at worst, false alarm below 1e-3.
        assert 0.25 < inside.mean() < 0.75


def test_priors_are_wide_about_the_data_and_not_absurd():
    table, _ = simulate(CAMPAIGN, 4)
    for panel in panels_of(table):
        mine = panel.points
        assert mine["force_kN"].min() > panel.band["lower_kN"].min()
        assert mine["force_kN"].max() < panel.band["upper_kN"].max()
        width = np.ptp(np.concatenate([panel.band["lower_kN"], panel.band["upper_kN"]]))
        assert 2 < width / np.ptp(mine["force_kN"]) < 30


@pytest.mark.parametrize("seed", [0, 5])
def test_the_same_seed_gives_the_same_records(seed):
    table, _ = simulate(CAMPAIGN, 5)
    one, same = (panels_of(table, seed=seed)[0].curves for _ in range(2))
    pd.testing.assert_frame_equal(one, same, check_exact=True)
    assert not one["force_kN"].equals(panels_of(table, seed=seed + 1)[0].curves["force_kN"])


def test_records_without_words_and_many_cells_and_repeats_are_shown_as_far_as_there_is_room():
    table, _ = simulate(Plan(configurations=tuple("abcd"), speeds=(0.0,), loads=(20.0,), repeats=7, points=30), 6)
    found = panels_of(table)
    assert len(found) == PANELS
    assert all(panel.points["record"].nunique() == REAL for panel in found)
    assert all(panel.like in set(panel.points["record"]) for panel in found)
    (bare,) = panels_of(table[["record", "displacement_mm", "force_kN"]])
    assert (bare.configuration, bare.direction) == ("", "")


def test_a_slope_over_actual_loads_in_the_posterior_is_one_in_the_priors():
    table, _ = simulate(Plan(configurations=("a",), speeds=(0.0,), loads=(20.0, 30.0), points=30), 7)
    factor_table = record_factors(table)
    draws = scattered(factor_table, seed=32)
    tree = posterior(draws, factor_table)
    nominal = prior_panels(tree, table)[0].curves
    slope = np.zeros((*draws["k"].shape[:2], 1))
    dataset = tree["posterior"].to_dataset().drop_vars("load", errors="ignore")
    tree["posterior"] = type(tree)(dataset.assign(log_k_load=(("chain", "draw", "load"), slope)))
    assert not prior_panels(tree, table)[0].curves["force_kN"].equals(nominal["force_kN"])


def test_few_records_are_drawn_and_repeats_are_judged_by_those_of_the_data(monkeypatch):
    table, _ = simulate(Plan(configurations=("a",), speeds=(0.0, 10.0, 20.0, 25.0), points=20), 8)
    cases = list(dict.fromkeys(case for case, _ in table["record"].str.rsplit("(", n=1)))
    single = table[table["record"].str.endswith("(1)") | table["record"].str.startswith(cases[-1])]
    drawn_for = []

    def spy(model, arguments, sites, draws, seed):
        drawn_for.append(arguments["factors"])
        return draw_prior(model, arguments, sites, draws, seed)

    monkeypatch.setattr(prior_curves, "draw_prior", spy)
    panels = panels_of(single)
    assert cases[-1] not in {panel.like.rsplit("(", 1)[0] for panel in panels}
    (factors,) = drawn_for
    assert factors.repeats.max() == 3
    assert 2 <= len(factors.of_record) < single["record"].nunique() / 2
