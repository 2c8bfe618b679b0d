"""Prediction: Equation 2 from the posterior's draws, for the cases that were asked for, with honest intervals."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered
from scipy.stats import binom

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.common_scales import with_scale
from bayes_tyre.inference.sampling.record_draws import thin_records
from bayes_tyre.record import Case
from bayes_tyre.results import prediction
from bayes_tyre.results.cases.selection import parse_query
from bayes_tyre.results.cases.stacked import Weighted, shares_of
from bayes_tyre.results.prediction import Prediction, force_kN, predictable_cases

FIGURES = ["mean", "sd", "lower", "upper"]
PARAMETERS = ["k_kN_per_mm", "beta_mm", "J_kN", "C_kN", "F_i_kN", "d_i_mm"]


def predict(tree: xr.DataTree, *texts: str, u: object = None, **more: object) -> Prediction:
    query = parse_query(texts, predictable_cases(tree))
    asked = None if u is None else np.asarray(u, dtype=float)
    options: Any = {"verdict": "pass", **more}
    return prediction.predict_stack([Weighted(tree, 1.0)], query, asked, **options)


def campaign(repeats: int = 3, **changed: tuple) -> xr.DataTree:
    factor_table = grid(repeats=repeats, **changed)
    return posterior(scattered(factor_table, seed=21), factor_table)


def single_case(**changed: np.ndarray) -> xr.DataTree:
    """Return a posterior of one case, `single (0)20-30`, that is sure of everything but what is given."""
    factor_table = grid(("single",), 3, speeds=(0.0,)).query("direction == 'loading'").reset_index(drop=True)
    of_record = {"k": 1.9, "beta": 0.07, "J": 0.4, "C": 3.2, "F_i": 15.0, "sigma": 0.03}
    draws = {name: fixed(np.full(3, value), draws=2000) for name, value in of_record.items()}
    draws |= {"k_case": fixed([1.8], draws=2000), "beta_case": fixed([0.05], draws=2000)}
    scalars = {"sd_log_k_repeat": 0.05, "sd_log_beta_repeat": 0.1, "sigma_typical": 0.02, "sd_log_sigma": 1e-9}
    draws |= {name: fixed(value, draws=2000) for name, value in scalars.items()}
    return posterior(draws | changed, factor_table)


def test_the_curve_of_a_case_is_equation_2_loading_up_and_unloading_down():
    tree = campaign()
    u = np.array([0.0, 0.01, 0.5, 3.0])
    group = tree["posterior"].to_dataset()
    for label, direction, sign in (("single (25)20-30", "loading", 1), ("single (25)30-20", "unloading", -1)):
        made = predict(tree, label, u=u).curves
        assert list(made.columns) == list(prediction.COLUMNS)
        np.testing.assert_array_equal(made["displacement_mm"], sign * u)
        assert not np.signbit(made["displacement_mm"].iloc[0])
        mine = [i for i, name in enumerate(group["record"].to_numpy()) if name.startswith(f"single 25 {direction}")]
        assert len(mine) == 3
        F_i, J = (group[name].to_numpy()[..., mine].mean(axis=-1).reshape(-1, 1) for name in ("F_i", "J"))
        k, beta = (group[f"{name}_case"].sel(case=label).to_numpy().reshape(-1, 1) for name in ("k", "beta"))
        force = F_i + (J + sign * k * u) * (1.0 - np.exp(-u / beta))
        np.testing.assert_allclose(
            made[["lower", "median", "upper"]].T, np.quantile(force, [0.025, 0.5, 0.975], axis=0)
        )
        said = made[["direction", "parameter", "unit", "of", "origin", "verdict"]].drop_duplicates()
        assert said.to_numpy().tolist() == [[direction, "force", "kN", "case", "simulated", "pass"]]


def test_parameters_of_a_tested_case_are_of_all_draws_where_its_records_were_thinned():
    whole = campaign()
    thinned = thin_records(whole, 40)
    (of_all,), (of_few,) = (predict(tree, "single (25)20-30").parameters for tree in (whole, thinned))
    assert {name: of_few[name] for name in ("k_kN_per_mm", "beta_mm")} == {
        name: of_all[name] for name in ("k_kN_per_mm", "beta_mm")
    }
    assert of_few["J_kN"] != of_all["J_kN"]  # which has no case level
    one, two = (Weighted(thinned, weight) for weight in (0.25, 0.75))
    query = parse_query(["single (25)20-30"], predictable_cases(whole))
    shares = shares_of([one, two])
    # 1000 draws of the cases; of the records ten from each of four chains.
    assert [(share.of_records, share.of_cases) for share in shares] == [(13, 333), (40, 1000)]
    made = prediction.predict_stack([one, two], query, verdict="pass")
    assert made.parameters[0]["k_kN_per_mm"] == pytest.approx(of_all["k_kN_per_mm"], rel=0.02)


def test_the_curve_follows_the_law_that_was_fitted():
    tree = single_case()
    tree.attrs["law"] = "small_step_limit"
    u = np.array([0.0, 0.02, 2.0])
    made = predict(tree, "single (0)20-30", u=u).curves
    np.testing.assert_allclose(made["median"], 15.0 + 0.4 * (1.0 - np.exp(-u / 0.05)) + 1.8 * u)


def test_the_interval_is_the_one_asked_for():
    wide, narrow = (predict(campaign(), "single (0)20-30", u=[1.0], interval=p) for p in (0.95, 0.5))
    for made, share in ((wide, 0.95), (narrow, 0.5)):
        assert set(made.curves["interval"]) == {share}
    inside = narrow.curves.iloc[0]
    assert wide.curves["lower"].iloc[0] < inside["lower"] < inside["median"] < inside["upper"]
    k = [made.parameters[0]["k_kN_per_mm"] for made in (wide, narrow)]
    assert k[0]["lower"] < k[1]["lower"] < k[1]["upper"] < k[0]["upper"]  # pyright: ignore[reportIndexIssue]


def test_parameters_are_those_of_the_curve_and_hold_together():
    tree = campaign()
    made = predict(tree, "dual (0)20-30").parameters
    assert [one["label"] for one in made] == ["dual (0)20-30"]
    one = made[0]
    assert list(one) == ["label", *Case._fields, *PARAMETERS]
    assert (one["configuration"], one["step_kN"]) == ("dual", 10.0)
    for name in PARAMETERS:
        assert list(one[name]) == FIGURES  # pyright: ignore[reportArgumentType, reportCallIssue]
        assert {type(figure) for figure in one[name].values()} == {float}  # pyright: ignore[reportAttributeAccessIssue]
    known = predict(single_case(), "single (0)20-30", u=[1.0]).parameters[0]
    mean = {name: known[name]["mean"] for name in PARAMETERS}  # pyright: ignore[reportIndexIssue]
    # d_i of the records, whose k is 1.9: (15 + 0.4 - 3.2) / 1.9; C of the case follows from its own k.
    d_i = (15.0 + 0.4 - 3.2) / 1.9
    expected = [1.8, 0.05, 0.4, 15.4 - 1.8 * d_i, 15.0, d_i]
    assert mean == pytest.approx(dict(zip(PARAMETERS, expected, strict=True)))


def test_an_unknown_scale_of_displacement_widens_the_curve_and_moves_its_start_with_it():
    tree = with_scale(single_case(), "displacement_scale", 0.05, seed=3)
    made = predict(tree, "single (0)20-30", u=[0.0, 3.0])
    width = (made.curves["upper"] - made.curves["lower"]).to_numpy()
    assert width[0] == pytest.approx(0.0, abs=1e-12)
    # k u is 5.4 kN and its relative sd 5 %; a quantile of 4000 draws is off by 3 % at one standard error.
    assert width[1] == pytest.approx(2 * 1.96 * 0.05 * 5.4, rel=0.12)
    d_i = made.parameters[0]["d_i_mm"]
    assert d_i["sd"] / d_i["mean"] == pytest.approx(0.05, rel=0.06)  # pyright: ignore[reportIndexIssue]
    assert made.parameters[0]["C_kN"]["sd"] == pytest.approx(0.0, abs=1e-9)  # pyright: ignore[reportIndexIssue]


def test_a_repeat_that_was_not_measured_is_on_another_tyre_on_another_day():
    levels = {"sd_log_k_specimen": fixed(0.1, draws=2000), "sd_log_k_day": fixed(0.05, draws=2000)}
    widths = [width_of_repeat(tree, "single (0)20-30", 3.0, 0.95) for tree in (single_case(), single_case(**levels))]
    # k u is 5.4 kN; of its logarithm 5 % of repeats, and 10 and 5 % more. A quantile of 4000 draws is off by 3 %.
    assert widths[1] / widths[0] == pytest.approx(np.sqrt(0.05**2 + 0.1**2 + 0.05**2) / 0.05, rel=0.15)


def test_without_displacements_the_curve_runs_as_far_as_the_records_of_the_case():
    factor_table = grid()
    tree = posterior(scattered(factor_table, seed=21), factor_table.assign(travel_mm=np.arange(1.0, 25.0)))
    for label, end in (("single (0)20-30", 3.0), ("single (0)30-20", -6.0)):
        made = predict(tree, label).curves
        np.testing.assert_allclose(made["displacement_mm"], np.linspace(0.0, end, 101))
    tree["posterior"] = xr.DataTree(tree["posterior"].to_dataset().drop_vars("record_travel_mm"))
    with pytest.raises(BadInput, match="how far its records go; give displacements"):
        predict(tree, "single (0)30-20")


def both_ways() -> xr.DataTree:
    """Return steps of 10 kN from 20 kN up and down, of -5 kN down alone, of two configurations."""
    steps = (("loading", 10.0), ("unloading", -10.0), ("unloading", -5.0))
    rows = [(f"{c} {s}", c, d, 0.0, 20.0, s) for c in ("single", "dual") for d, s in steps]
    factor_table = pd.DataFrame(rows, columns=["record", *Case._fields])
    return posterior(scattered(factor_table, seed=22), factor_table)


def test_cases_asked_for_come_loading_before_unloading_and_what_has_no_opposite_is_said():
    made = predict(both_ways(), "configuration=single", u=[0.0, 1.0])
    steps = made.curves[["direction", "step_kN"]].drop_duplicates()
    assert steps.to_numpy().tolist() == [["loading", 10.0], ["unloading", -10.0], ["unloading", -5.0]]
    assert [one["step_kN"] for one in made.parameters] == [10.0, -10.0, -5.0]
    assert made.warnings == ("no opposite direction of single (0)20-15",)


@pytest.mark.parametrize(
    ("asked", "up", "down"),
    [
        ([3.0, 0.0, 1.0], [3.0, 0.0, 1.0], [-3.0, 0.0, -1.0]),
        ([-2.0, 0.0, 3.0], [0.0, 3.0], [-2.0, 0.0]),
        ([-2.0, -1.0], [], [-2.0, -1.0]),
        ([-2.0, 0.0], [], [-2.0, 0.0]),
        ([0.0], [0.0], [0.0]),
    ],
)
def test_magnitudes_serve_both_directions_and_signed_displacements_each_its_own(asked, up, down):
    made = predict(both_ways(), "single (0)20-10", u=asked)
    by_direction = {d: rows.tolist() for d, rows in made.curves.groupby("direction")["displacement_mm"]}
    assert by_direction == {name: u for name, u in (("loading", up), ("unloading", down)) if u}
    left_out = ["no displacement has the sign of single (0)20-30"]
    assert list(made.warnings) == ([] if up else left_out)
    assert len(made.parameters) == 1 + bool(up)


def test_displacements_that_no_case_can_use_are_refused():
    with pytest.raises(BadInput, match=r"no displacement has the sign of single .* both signs"):
        predict(single_case(), "single (0)20-30", u=[-1.0, 0.0])


def test_a_case_without_direction_takes_displacements_as_they_are_and_needs_them():
    factor_table = pd.DataFrame({"record": ["a", "b"]})
    tree = posterior(scattered(factor_table, seed=24), factor_table)
    made = predict(tree, "all records", u=[-2.0, 0.0, 2.0])
    assert made.curves["displacement_mm"].tolist() == [-2.0, 0.0, 2.0]
    assert made.curves[list(Case._fields)].isin(["", None]).all(axis=None)
    assert list(made.parameters[0]) == ["label", *PARAMETERS]
    assert made.warnings == ()


def test_a_repeat_holds_new_records_at_the_stated_rate():
    """New records are drawn here as the hierarchy has them, each with its own k, beta, noise."""
    starts = {"F_i": fixed([15.0, 15.0, 15.3], draws=2000), "J": fixed([0.4, 0.4, 0.5], draws=2000)}
    tree = single_case(**starts)
    u, new, rng = 2.0, 4000, np.random.default_rng(25)
    band = predict(tree, "single (0)20-30", u=[u], of="repeat", interval=0.8).curves.iloc[0]
    of = rng.integers(3, size=new)
    k, beta = 1.8 * np.exp(0.05 * rng.normal(size=new)), 0.05 * np.exp(0.1 * rng.normal(size=new))
    F_i, J = np.array([15.0, 15.0, 15.3])[of], np.array([0.4, 0.4, 0.5])[of]
    force = F_i + (J + k * u) * -np.expm1(-u / beta) + 0.02 * rng.normal(size=new)
    inside = np.mean((band["lower"] < force) & (force < band["upper"]))
    # Two binomial errors, of 4000 new records and of 4000 draws; a false alarm in 1e-4 for the two together.
    spread = np.sqrt(2) * (binom.ppf(1 - 5e-5, new, 0.8) / new - 0.8)
    assert inside == pytest.approx(0.8, abs=spread)
    assert band["of"] == "repeat"
    case = predict(tree, "single (0)20-30", u=[u]).curves.iloc[0]
    assert case["upper"] - case["lower"] == pytest.approx(0.0, abs=1e-12)


def width_of_repeat(tree: xr.DataTree, label: str, u: float, interval: float = 0.6827) -> float:
    """Return half the interval of a repeat (kN)."""
    row = predict(tree, label, u=[u], of="repeat", interval=interval).curves.iloc[0]
    return float(row["upper"] - row["lower"]) / 2


def test_a_repeat_scatters_as_repeats_do_at_its_speed():
    factor_table = grid(("single",), 3)
    draws = scattered(factor_table, seed=26, draws=1000) | {
        "k_case": fixed([1.8] * 4, chains=4, draws=1000),
        "sd_log_k_repeat": fixed(1.0, chains=4, draws=1000),
        "sd_log_k_repeat_by_speed": fixed([0.02, 0.2], chains=4, draws=1000),
        "sd_log_beta_repeat": fixed(0.1, chains=4, draws=1000),
        "sd_log_sigma": fixed(0.1, chains=4, draws=1000),
    }
    tree = posterior(draws, factor_table)
    slow, fast = (width_of_repeat(tree, f"single ({speed})20-30", 100.0) / 180.0 for speed in (0, 25))
    # Half the central 68 % of a log-normal is its scatter; the quantiles of 4000 draws leave 2 % of it uncertain.
    assert slow == pytest.approx(0.02, rel=0.1)
    assert fast == pytest.approx(0.2, rel=0.1)


def test_a_repeat_may_be_discordant_as_often_as_the_posterior_says():
    always = fixed(1.0, draws=2000)
    usual, widened = single_case(), single_case(discordant_weight=always)
    ratio = width_of_repeat(widened, "single (0)20-30", 100.0) / width_of_repeat(usual, "single (0)20-30", 100.0)
    assert ratio == pytest.approx(6.0, rel=0.1)


#: Repeats that are their case but for the noise.
ALIKE = {name: fixed(1e-9, draws=2000) for name in ("sd_log_k_repeat", "sd_log_beta_repeat")}


def test_the_noise_of_a_repeat_is_that_of_a_new_record():
    assert width_of_repeat(single_case(**ALIKE), "single (0)20-30", 0.0) == pytest.approx(0.02, rel=0.1)
    spread = single_case(**ALIKE, sd_log_sigma=fixed(2.0, draws=2000))
    assert width_of_repeat(spread, "single (0)20-30", 0.0, 0.99) > 5 * 2.58 * 0.02


def test_the_noise_of_a_repeat_has_the_tails_of_the_posterior():
    heavy = single_case(**ALIKE, noise_nu=fixed(2.0, draws=2000))
    # The 95 % quantile of a t(2) is 2.92, of a normal 1.64; 8,000 draws leave 3 % of it uncertain.
    assert width_of_repeat(heavy, "single (0)20-30", 0.0, 0.9) == pytest.approx(2.92 * 0.02, rel=0.12)


def test_a_posterior_without_the_scatter_of_repeats_tells_of_no_repeat():
    tree = campaign()
    with pytest.raises(BadInput, match=r"lacks sd_log_k_repeat.*; ask for the case"):
        predict(tree, "single (0)20-30", of="repeat")
    with pytest.raises(BadInput, match="case or repeat"):
        predict(tree, "single (0)20-30", of="nonsense")


def test_the_seed_and_the_case_alone_decide_what_a_repeat_adds():
    scatter = {f"sd_log_{name}_repeat": fixed(0.05, chains=4, draws=250) for name in ("k", "beta")}
    factor_table = grid()
    tree = posterior(scattered(factor_table, seed=27) | scatter | {"sd_log_sigma": fixed(0.1, 4, 250)}, factor_table)
    one, same, other = (predict(tree, "dual (0)20-30", of="repeat", seed=seed).curves for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(one, same, check_exact=True)
    assert not one["median"].equals(other["median"])
    among = predict(tree, "speed_km_h=0", of="repeat", seed=1).curves
    picked = among.query("configuration == 'dual' and direction == 'loading'").reset_index(drop=True)
    pd.testing.assert_frame_equal(picked, one, check_exact=True)


def test_many_points_are_computed_in_parts_with_the_same_result(monkeypatch):
    tree, u = campaign(), np.linspace(0.0, 4.0, 37)
    whole = predict(tree, "single (0)20-30", u=u).curves
    monkeypatch.setattr(prediction, "CELLS", 3000)
    pd.testing.assert_frame_equal(predict(tree, "single (0)20-30", u=u).curves, whole, check_exact=True)


def test_the_force_is_exact_where_beta_is_far_below_or_above_the_travel():
    u = np.array([1e-9, 1.0])
    np.testing.assert_allclose(force_kN(u, *np.array([2.0, 0.4, 1.8, 1e-12])[:, None]), 2.0 + 0.4 + 1.8 * u)
    np.testing.assert_allclose(force_kN(u, *np.array([0.0, 1.0, 0.0, 1e9])[:, None]), u / 1e9, rtol=1e-8)


def without(*names: str) -> xr.DataTree:
    tree = campaign()
    tree["posterior"] = xr.DataTree(tree["posterior"].to_dataset().drop_vars(names))
    return tree


def test_only_a_posterior_of_records_can_be_predicted_from():
    factor_table = grid(repeats=1).drop(columns=["record", "repeat"])
    k = fixed(np.ones(len(factor_table)))
    printed = posterior({"k_case": k, "beta_case": k}, factor_table, origin="published")
    nameless = campaign()
    del nameless.attrs["origin"]
    for tree, said in (
        (printed, "no records"),
        (xr.DataTree(), "no posterior of this program"),
        (nameless, "no posterior of this program"),
        (without("k_case", "J"), "lacks k_case, J"),
        (without("case_step_kN"), "lacks case_step_kN"),
    ):
        with pytest.raises(BadInput, match=said):
            predictable_cases(tree)


def stacked(*models: tuple[xr.DataTree, float], u: list[float]) -> Prediction:
    query = parse_query(["single (0)20-30"], predictable_cases(models[0][0]))
    return prediction.predict_stack([Weighted(*model) for model in models], query, np.asarray(u), verdict="pass")


def wide(seed: int, **attributes: str) -> xr.DataTree:
    k = np.random.default_rng(seed).normal(1.8 + 0.4 * seed, 0.05, fixed([0.0], draws=2000).shape)
    tree = single_case(k_case=k)
    tree.attrs |= attributes
    return tree


def test_a_stack_draws_from_each_model_as_often_as_its_weight_is():
    one, other = wide(0), wide(1)
    made = stacked((one, 0.3), (other, 0.1), u=[3.0])
    k = np.concatenate([one["posterior"]["k_case"].to_numpy().ravel(), other["posterior"]["k_case"].to_numpy().ravel()])
    weight = np.repeat([1.5 / len(k), 0.5 / len(k)], len(k) // 2)
    order = np.argsort(k)
    # All draws of the one and a third of the other's: thinning moves a quantile by less than its Monte Carlo error.
    expected = k[order][np.searchsorted(np.cumsum(weight[order]), [0.025, 0.5, 0.975])]
    said = made.curves[["lower", "median", "upper"]].to_numpy()[0]
    np.testing.assert_allclose(said, 15.0 + (0.4 + 3.0 * expected), atol=0.04)
    statistics = made.parameters[0]["k_kN_per_mm"]
    assert isinstance(statistics, dict)
    assert statistics["mean"] == pytest.approx(np.sum(weight * k), abs=0.003)


def test_a_model_without_weight_says_nothing():
    one, other = wide(0), wide(1, law="small_step_limit")
    alone = predict(one, "single (0)20-30", u=[0.0, 0.05, 3.0])
    both = stacked((one, 2.0), (other, 0.0), u=[0.0, 0.05, 3.0])
    pd.testing.assert_frame_equal(both.curves, alone.curves)
    assert both.parameters == alone.parameters


def test_models_of_different_laws_have_a_curve_together_and_no_parameters():
    one, other = wide(0), wide(1, law="small_step_limit")
    made = stacked((one, 0.5), (other, 0.5), u=[0.05])
    gone = 1.0 - np.exp(-1.0)  # at u = beta
    k, other_k = (tree["posterior"]["k_case"].to_numpy().ravel() for tree in (one, other))
    forces = 15.0 + (0.4 + 0.05 * k) * gone, 15.0 + 0.4 * gone + 0.05 * other_k
    expected = np.quantile(np.concatenate(forces), [0.025, 0.5, 0.975])
    np.testing.assert_allclose(made.curves[["lower", "median", "upper"]].to_numpy()[0], expected, rtol=1e-12)
    assert made.parameters == ()
    assert made.warnings[-1] == "the models have different laws: there are no parameters of one of them"


def test_models_of_other_cases_and_without_weights_are_refused():
    with pytest.raises(BadInput, match="other cases"):
        stacked((wide(0), 0.5), (campaign(), 0.5), u=[1.0])
    with pytest.raises(BadInput, match="weights of all models are 0"):
        stacked((wide(0), 0.0), (wide(1), 0.0), u=[1.0])
