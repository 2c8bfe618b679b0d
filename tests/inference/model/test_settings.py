"""What the model of records is told beside the records: the region, the load that counts, the displacement's scale."""

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid
from helpers.simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.prepared_records import record_batch, used_points
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

pytestmark = pytest.mark.usefixtures("iterations_fully_compiled")

#: Of log k, per 10 kN.
SLOPE = 0.4
FIRST_70_PER_CENT = {1: 1, 2: 2, 10: 7, 11: 8, 1198: 839}


@pytest.mark.parametrize(
    "wrong",
    [
        {"region": "half"},
        {"initial_load": "guessed"},
        {"displacement_scale_sd": -0.1},
        {"displacement_scale_sd": float("nan")},
        {"displacement_scale_sd": float("inf")},
        {"force_scale_sd": -0.01},
        {"likelihood": "guessed"},
        {"repeats": "cauchy"},
        {"noise": "pink"},
        {"sampler": "gibbs"},
        {"noise_window": 0},
        {"noise": "ar1", "noise_window": 801},
        {"noise": "student", "noise_window": 801},
        {"noise": "student", "displacement_sd": 0.01},
        {"displacement_sd": -0.01},
        {"displacement_sd": float("nan")},
        {"displacement_sd": 0.01, "noise_window": 801},
    ],
)
def test_settings_that_cannot_be_are_refused(wrong):
    with pytest.raises(BadInput):
        ModelSettings(**wrong)


@pytest.mark.parametrize(
    ("given", "correlation", "uneven"),
    [
        ({}, "ar1", True),
        ({"noise_window": 801}, "iid", False),
        ({"noise": "ar1"}, "ar1", False),
        ({"noise": "iid"}, "iid", False),
        ({"noise": "student"}, "student", False),
    ],
)
def test_noise_is_taken_as_the_records_show_it_unless_it_is_stated(given, correlation, uneven):
    model = ModelSettings(**given)
    assert (model.correlation, model.uneven) == (correlation, uneven)


def test_the_thesis_region_is_the_first_70_per_cent_of_each_record():
    lengths = list(FIRST_70_PER_CENT)
    names = np.repeat([f"r{n}" for n in lengths], lengths)
    shuffled = np.random.default_rng(1).permutation(names)  # records may lie between each other
    table = pd.DataFrame({"record": shuffled, "force_kN": np.arange(len(names), dtype=float)})
    kept = used_points(table, "thesis")
    for n, expected in FIRST_70_PER_CENT.items():
        whole = table.loc[table["record"] == f"r{n}", "force_kN"].tolist()
        assert kept.loc[kept["record"] == f"r{n}", "force_kN"].tolist() == whole[:expected]
    pd.testing.assert_frame_equal(used_points(table, "all"), table)


@pytest.mark.parametrize("column", ["displacement_mm", "force_kN"])
def test_a_number_that_is_no_measurement_is_refused_by_record_and_column(column):
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=2), seed=2)
    table.loc[70, column] = -1e308
    with pytest.raises(BadInput, match=f"20-25.2.*column {column}: 1e.308.*; check the cells"):
        record_batch(check_record_table(table))


def test_the_slope_over_the_actual_force_is_told_per_10_kN_from_the_mean_of_each_case():
    factor_table = grid(("single",), repeats=2)
    force = np.array([10.0, 12.0, 20.0, 22.0, 11.0, 11.0, 30.0, 30.0])
    load = find_factors(factor_table, force).load
    assert load.varies
    assert load.labels == ("per 10 kN",)
    assert load.matrix[:, 0] == pytest.approx(np.array([11.0, 21.0, 11.0, 30.0]) / 10 - 1.825)
    assert not find_factors(factor_table, np.full(8, 7.0)).load.varies
    assert find_factors(factor_table).load.labels == (20.0, 30.0)


@pytest.mark.slow
def test_the_slope_over_the_actual_force_comes_back():
    table, _ = simulate(Plan(repeats=2), seed=3)
    case = table["record"].str.replace(r"\(\d\)$", "", regex=True)
    rng = np.random.default_rng(4)
    really = case.map({name: rng.uniform(10.0, 40.0) for name in case.unique()})  # whatever the nominal load says
    first = table.groupby("record")[["displacement_mm", "force_kN"]].transform("first")
    stiffer = np.exp(SLOPE * (really - 25.0) / 10.0)
    table["displacement_mm"] = (
        first["displacement_mm"] + (table["displacement_mm"] - first["displacement_mm"]) / stiffer
    )
    table["force_kN"] += really - first["force_kN"]
    settings = SamplerSettings(chains=4, warmup=300, draws=300, seed=1, target_accept=0.65)
    tree = fit_hierarchical(check_record_table(table), settings, ModelSettings(initial_load="actual"))
    slope = tree["posterior"]["log_k_load"].to_numpy().ravel()
    # Sixteen cases scatter by 8 % over forces of sd 8.7 kN, and five terms beside the slope are fitted: its standard
    # error is 0.08 / (0.87 sqrt(16 - 6)) = 0.03. Five of them are allowed: false alarms below one in a million.
    assert np.median(slope) == pytest.approx(SLOPE, abs=0.15)
    assert np.mean(slope > 0) > 0.99
