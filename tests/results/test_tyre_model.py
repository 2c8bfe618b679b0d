"""Cases as a vehicle simulator needs them: SI units, medians and intervals as in the tables, curves by hand."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import TYRE, grid, motion_cases, posterior, scattered
from helpers.slow_tests import Tyre, on_flat_ground

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.load_deflection.table import fit_tests
from bayes_tyre.inference.sampling.record_draws import thin_records
from bayes_tyre.results import summary
from bayes_tyre.results.tyre_model import ONE_WAY, Curves, TyreModel, of_load_deflection, of_posterior
from bayes_tyre.signals.load_deflection import check_load_deflection, with_deflection

PER_SI = {"k": 1e6, "beta": 1e-3}


def curves_of(model: TyreModel) -> Curves:
    assert model.curves is not None
    return model.curves


@pytest.fixture(scope="module")
def records() -> xr.DataTree:
    factor_table = grid(("single",), repeats=2)
    return posterior(scattered(factor_table, seed=7), factor_table)


def test_parameters_are_those_of_cases_csv_in_si_units(records):
    table = summary.cases(records, "pass").set_index(["direction", "speed_km_h", "parameter"])
    models = of_posterior(records)
    assert [model.label for model in models] == [
        *("single (0)20-30", "single (0)30-20"),
        *("single (25)20-30", "single (25)30-20"),
    ]
    cases = [("loading", 0), ("unloading", 0), ("loading", 25), ("unloading", 25)]
    for model, (direction, speed) in zip(models, cases, strict=True):
        assert set(model.parameters) == {"k", "beta", "J", "C", "F_i"}
        for name, factor in PER_SI.items():
            row = table.loc[(direction, speed, name), ["median", "lower", "upper"]].to_numpy(float)
            np.testing.assert_allclose(model.parameters[name][:3], factor * row, rtol=1e-9)
    assert [model.parameters[name].unit for name in ("k", "beta", "J")] == ["N/m", "m", "N"]


def test_k_and_beta_are_of_all_draws_where_records_were_thinned(records):
    for whole, few in zip(of_posterior(records), of_posterior(thin_records(records, 40)), strict=True):
        assert [few.parameters[name] for name in PER_SI] == [whole.parameters[name] for name in PER_SI]
        assert few.parameters["J"] != whole.parameters["J"]
        # A median of 40 draws: its error is 1.25 sd / sqrt(40) = 0.2 sd, and of the force sd is up to 3 %.
        np.testing.assert_allclose(curves_of(few).path.force, curves_of(whole).path.force, rtol=0.03)


def test_the_curve_of_a_step_is_equation_2_from_its_start_as_far_as_its_records_go(records):
    loading, unloading = of_posterior(records)[:2]
    for model, sign in ((loading, 1), (unloading, -1)):
        path, spline, _, lost = curves_of(model)
        assert path.deflection[0] == 0.0
        assert not np.signbit(path.deflection[0])
        assert path.deflection[-1] == pytest.approx(sign * 4e-3)
        assert (np.diff(spline.deflection) > 0).all()
        assert (spline.force == path.force[::sign]).all()
        k, beta, J, F_i = (model.parameters[name].value for name in ("k", "beta", "J", "F_i"))
        by_hand = F_i + (J + k * path.deflection) * (1 - np.exp(-np.abs(path.deflection) / beta))
        # The force at the medians, against the median of the force: apart by far less than the interval.
        assert (np.abs(by_hand - path.force) < 0.15 * (path.upper - path.lower) + 1.0).all()
        assert (path.lower < path.force).all()
        assert (path.force < path.upper).all()
        assert lost == ONE_WAY


def test_a_quantile_is_that_of_each_parameter_and_of_the_force_at_each_deflection(records):
    median, lower = (of_posterior(records, level)[0] for level in (0.5, 0.025))
    assert lower.parameters["k"].value == pytest.approx(median.parameters["k"].lower)
    np.testing.assert_allclose(curves_of(lower).path.force, curves_of(median).path.lower)
    assert lower.parameters["k"].upper == median.parameters["k"].upper


def test_printed_cases_have_parameters_and_no_curve():
    factor_table = grid(("single",), 1).drop(columns=["record", "repeat"])
    draws = {name: of for name, of in scattered(grid(("single",), 1), 3).items() if name in ("k_case", "beta_case")}
    model = of_posterior(posterior(draws, factor_table))[0]
    assert set(model.parameters) == {"k", "beta"}
    assert model.curves is None


def test_a_motion_has_a_closed_loop_about_its_middle_line_that_loses_what_friction_does():
    single, dual = of_posterior(motion_cases(amplitude_mm=2.0))
    k, x, beta = 1e6 * TYRE["k"], 1e3 * TYRE["x"], 1e-3 * TYRE["beta"]
    path, spline, _, lost = curves_of(single)
    assert [path.deflection.min(), path.deflection.max()] == pytest.approx([-2e-3, 2e-3])
    np.testing.assert_allclose(spline.force, k * spline.deflection, atol=1e-6)
    energy = np.trapezoid(path.force, path.deflection)
    # Beyond many beta the branches are settled: 4 a (x - k beta), less what the corners take.
    settled = x - k * beta
    assert energy == pytest.approx(4 * 2e-3 * settled * (1 - beta / 2e-3), rel=2e-3)
    assert f"{settled:.0f} N above" in lost
    assert dual.parameters["x"].value == pytest.approx(2 * x)
    assert single.parameters["m"] == (280.0, 280.0, 280.0, "kg")


def test_a_motion_on_another_law_has_no_curve():
    tree = motion_cases()
    tree.attrs["law"] = "bouc_wen"
    assert of_posterior(tree)[0].curves is None


def test_a_slow_test_has_a_curve_from_first_touch_between_its_branches():
    tyre = Tyre(k=1.5, C=0.3)
    rows = fit_tests(with_deflection(check_load_deflection(on_flat_ground(tyre, 0.01, 1)), {"": None}))
    (model,) = of_load_deflection(pd.concat([rows, rows.assign(k_kN_per_mm=np.nan)]))
    k, C = model.parameters["k"], model.parameters["C"]
    assert k.lower < 1.5e6 < k.upper
    assert k.upper - k.lower == pytest.approx(2 * 1.96e6 * rows["k_kN_per_mm_se"].item(), rel=1e-3)
    path, spline = curves_of(model)[:2]
    assert (spline.deflection[0], spline.force[0]) == (0.0, 0.0)
    assert [spline.deflection[1], spline.deflection[-1]] == pytest.approx([1.7e-3, 20e-3])
    np.testing.assert_allclose(spline.force[1:], k.value * spline.deflection[1:] + C.value)
    assert np.isnan(spline.upper).all()
    assert np.ptp(path.deflection) == pytest.approx(18.3e-3)
    assert "from 0 0 to the first reading" in curves_of(model).lost
    assert model.status.startswith("status: ")


def test_what_is_no_posterior_of_cases_is_refused():
    with pytest.raises(BadInput, match="no posterior of cases"):
        of_posterior(xr.DataTree())
