"""Common factors on displacement and force: what moves with them, what does not, and no ratio."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling import hierarchical_fit
from bayes_tyre.inference.sampling.common_scales import POWERS, as_measured, with_scale, with_scales_of
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.record_table import check_record_table
from bayes_tyre.results.contrasts import contrasts

#: Powers with which each quantity follows a factor, as the laws have it.
FOLLOW = {
    "displacement_scale": {"k": -1, "k_case": -1, "k_group": -1, "beta": 1, "beta_case": 1, "beta_group": 1},
    "force_scale": dict.fromkeys(("k", "k_case", "k_group", "J", "sd_J", "C", "F_i", "sigma", "sigma_typical"), 1),
}


def before() -> xr.DataTree:
    factor_table = grid()
    return posterior(scattered(factor_table, seed=1), factor_table)


@pytest.mark.parametrize("name", FOLLOW)
def test_a_common_factor_moves_all_that_follow_it_together_and_no_ratio(name):
    tree = before()
    after = with_scale(tree, name, 0.05, seed=3)
    old, new = tree["posterior"].to_dataset(), after["posterior"].to_dataset()
    # 1000 draws: the standard deviation of a sample sd is 2.2 %; four of them.
    assert float(np.log(new[name]).std()) == pytest.approx(0.05, rel=0.09)
    for variable in old.data_vars:
        expected = old[variable] * new[name] ** FOLLOW[name].get(variable, 0)
        np.testing.assert_allclose(new[variable], expected.transpose(*old[variable].dims), rtol=1e-14)
        assert new[variable].dims == old[variable].dims
        assert new[variable].attrs == old[variable].attrs
    assert name not in old
    columns = ["median", "lower", "upper", "p_greater_than_1"]
    ratios = [contrasts(each, "pass")[columns].to_numpy() for each in (tree, after)]
    np.testing.assert_allclose(ratios[1], ratios[0], rtol=1e-12)
    again = with_scale(tree, name, 0.05, seed=3)["posterior"]["k"]
    np.testing.assert_array_equal(again, new["k"])


def test_how_well_factors_are_known_is_the_tables_unless_it_is_given():
    table = pd.DataFrame({"record": list("abc"), "force_scale_sd": [0.01, np.nan, 0.02]})
    model = with_scales_of(table, ModelSettings())
    assert (model.force_scale_sd, model.displacement_scale_sd) == (0.02, 0.0)
    assert with_scales_of(table, ModelSettings(force_scale_sd=0.0)).force_scale_sd == 0.0
    assert with_scales_of(table.assign(force_scale_sd=["0.01", "", " "]), ModelSettings()).force_scale_sd == 0.01
    for empty in (np.nan, ""):
        assert with_scales_of(table.assign(force_scale_sd=empty), ModelSettings()).force_scale_sd == 0.0
    assert with_scales_of(table.assign(displacement_scale_sd="0.05"), model) == model


def test_a_fit_takes_the_factors_that_its_table_names(monkeypatch):
    """Of draws put there in place of the sampler's."""
    monkeypatch.setattr(hierarchical_fit, "fit_prepared", lambda *_: before())
    table = check_record_table(simulate(Plan(), 1)[0].assign(force_scale_sd=0.02))
    assert set(POWERS) & set(fit_hierarchical(table)["posterior"].data_vars) == {"force_scale"}
    plain = fit_hierarchical(table, model=ModelSettings(force_scale_sd=0.0, displacement_scale_sd=0.1))
    assert set(POWERS) & set(plain["posterior"].data_vars) == {"displacement_scale"}


@pytest.mark.parametrize("cell", ["good", -0.01, np.inf, 2.0])
def test_a_column_that_is_no_standard_deviation_is_refused(cell):
    table = pd.DataFrame({"record": list("abc"), "displacement_scale_sd": [0.01, cell, 0.01]})
    with pytest.raises(BadInput, match=rf"record 'b', column displacement_scale_sd: '{cell}' is no .*; mend the cell"):
        with_scales_of(table, ModelSettings())


def test_what_was_measured_is_what_was_scaled_by_both_factors():
    tree = before()
    both = with_scale(with_scale(tree, "displacement_scale", 0.05, seed=3), "force_scale", 0.02, seed=4)
    found, expected = as_measured(both["posterior"].to_dataset()), tree["posterior"].to_dataset()
    for variable in expected.data_vars:
        np.testing.assert_allclose(found[variable], expected[variable], rtol=1e-12)


def test_curves_of_a_law_are_those_measured_times_the_factors():
    """The factors are what makes the law hold for true force over true displacement."""
    both = with_scale(with_scale(before(), "displacement_scale", 0.05, seed=3), "force_scale", 0.02, seed=4)
    new, old = both["posterior"].to_dataset(), before()["posterior"].to_dataset()
    u = 0.03

    def force(draws: xr.Dataset, u: xr.DataArray | float) -> xr.DataArray:
        return draws["F_i"] + (draws["J"] + draws["k"] * u) * (1.0 - np.exp(-u / draws["beta"]))

    np.testing.assert_allclose(
        force(new, u * new["displacement_scale"]), new["force_scale"] * force(old, u), rtol=1e-12
    )
    of_C, of_old_C = (draws["F_i"] + draws["J"] - draws["C"] for draws in (new, old))
    d_i, old_d_i = of_C / new["k"], of_old_C / old["k"]
    np.testing.assert_allclose(d_i, new["displacement_scale"] * old_d_i, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "powers"),
    [
        ("force_scale", {"k": 1, "x": 1, "m": 1, "c": 1, "beta": 0}),
        ("displacement_scale", {"k": -1, "x": 0, "m": -1, "c": -1, "beta": 1}),
    ],
)
def test_the_equation_of_motion_holds_for_true_forces_over_true_displacements(name, powers):
    """Mass, damper and tyre follow a factor on force as the force does that was applied to them, and one on way."""
    values = {"k": 1.0, "x": 2.0, "m": 3.0, "c": 4.0, "beta": 5.0}
    draws = {name: (("chain", "draw", "record"), np.full((2, 500, 3), value)) for name, value in values.items()}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(draws)})
    after = with_scale(tree, name, 0.02, seed=1)["posterior"].to_dataset()
    # 1000 draws: the standard deviation of a sample sd is 2.2 %; four of them.
    assert float(np.log(after[name]).std()) == pytest.approx(0.02, rel=0.09)
    for parameter, power in powers.items():
        expected = values[parameter] * (after[name] ** power).broadcast_like(after[parameter])
        np.testing.assert_allclose(after[parameter], expected, rtol=1e-14)
    for parameter, value in values.items():
        np.testing.assert_allclose(as_measured(after)[parameter], value, rtol=1e-12)
