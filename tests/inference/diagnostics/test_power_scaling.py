"""Contraction and prior sensitivity: against cases whose answer is known, and for both kinds of fit."""

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.data_checks import find_limitations
from bayes_tyre.inference.diagnostics.power_scaling import (
    GROUP,
    MEASURES,
    PRIOR_SITES,
    contraction,
    decided_by,
    identified,
    identify_published,
    identify_records,
    sensitivity,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.models import published_model, records_model
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.prior_predictive import draw_prior, usual_repeats
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import RecordData
from bayes_tyre.inference.sampling.datatree import to_datatree
from bayes_tyre.published import tables
from bayes_tyre.record_table import record_factors
from bayes_tyre.results import summary

SHAPE = (4, 500)


def draws_of(**named: np.ndarray) -> xr.Dataset:
    return xr.Dataset({name: (("chain", "draw"), values) for name, values in named.items()})


def normal(spread: float, seed: int) -> np.ndarray:
    return spread * np.random.default_rng(seed).standard_normal(SHAPE)


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        *(("k_case", np.exp), ("sigma_typical", np.exp), ("J", lambda x: x), ("rho", np.tanh)),
        *(("log_k_speed", lambda x: x), ("n_case", np.exp), ("belt_frequency_mean", np.exp)),
    ],
)
def test_contraction_is_that_of_the_variance_on_the_scale_the_prior_is_given_on(name, scale):
    wide, narrow = normal(1.0, 1), normal(0.3, 2)
    found = contraction(draws_of(**{name: scale(0.5 + narrow)}), draws_of(**{name: scale(wide)}))
    assert float(found[name]) == pytest.approx(1 - narrow.var() / wide.var(), rel=1e-9)
    assert float(contraction(draws_of(k=np.exp(wide)), draws_of(k=np.exp(narrow)))["k"]) < 0


def conjugate(data_precision: float, prior_mean: float = 0.0) -> tuple[xr.Dataset, dict[str, xr.Dataset]]:
    """Return draws of a normal mean under a prior of sd 1 and one datum at 0, and its sensitivities."""
    precision = 1.0 + data_precision
    mean = prior_mean / precision + normal(precision**-0.5, 7)
    groups = (draws_of(p=-0.5 * (mean - prior_mean) ** 2), draws_of(y=-0.5 * data_precision * mean**2))
    return draws_of(J=mean), sensitivity(draws_of(J=mean), *groups)


def test_a_datum_that_outweighs_the_prior_decides_and_one_that_does_not_leaves_it_to_the_prior():
    _, weak = conjugate(0.01)
    _, strong = conjugate(100.0)
    assert float(weak["prior_sensitivity"]["J"]) > 0.05 > float(weak["likelihood_sensitivity"]["J"])
    assert float(strong["likelihood_sensitivity"]["J"]) > 0.05 > float(strong["prior_sensitivity"]["J"])
    _, conflict = conjugate(1.0, prior_mean=6.0)
    assert min(float(conflict[name]["J"]) for name in conflict) > 0.05


def test_the_floor_is_what_pure_noise_gives_and_grows_with_what_bears_on_nothing():
    mean = normal(1.0, 8)
    quiet, loud = (draws_of(y=normal(spread, 9)) for spread in (1.0, 20.0))
    floors = [
        sensitivity(draws_of(J=mean), draws_of(p=normal(1, 3)), y)["likelihood_sensitivity"] for y in (quiet, loud)
    ]
    assert floors[0].attrs["floor"] < 0.05 < floors[1].attrs["floor"]


@pytest.mark.parametrize("where", ["quantity", "density"])
def test_draws_that_are_no_numbers_have_no_sensitivity(where):
    bad = normal(1.0, 1)
    bad[0, 3] = np.nan
    quantity, density = (bad, normal(1, 2)) if where == "quantity" else (normal(1, 2), bad)
    found = sensitivity(draws_of(J=quantity), draws_of(p=density), draws_of(y=normal(1, 4)))
    assert found == {}


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ((0.9, 0.01, 0.01), "data"),
        ((0.9, 0.10, 0.01), "both"),
        ((0.9, 0.10, 0.20), "data"),
        ((0.1, 0.10, 0.01), "prior"),
        ((0.1, 0.01, 0.01), "unclear"),
        ((np.nan, 0.1, 0.01), ""),
        ((0.9, np.nan, 0.01), ""),
    ],
)
def test_what_decides_is_said_in_a_word(figures, said):
    assert decided_by(*figures) == said


@pytest.fixture(scope="module")
def of_records():
    """Return hand-made draws of records, identified: one case's beta is as wide as its prior, sd_J is its prior."""
    table, _ = simulate(
        Plan(configurations=("single",), speeds=(0.0, 25.0), loads=(20.0,), steps=(5.0, -5.0), points=30), 1
    )
    factor_table, rng = record_factors(table), np.random.default_rng(6)
    draws = scattered(factor_table, seed=4)
    draws["beta_case"] = draws["beta_case"] * np.exp(
        2.2 * rng.standard_normal(draws["beta_case"].shape) * (np.arange(4) == 2)
    )
    draws["sd_J"] = np.abs(PRIORS["sd_J"].parameters[0] * rng.standard_normal((*SHAPE[:1], 250)))
    records = prepare_records(table, ModelSettings())
    return identify_records(posterior(draws, factor_table), records, ModelSettings())


def test_every_quantity_of_records_has_its_measures_with_its_labels(of_records):
    group = of_records[GROUP].to_dataset()
    kept = of_records["posterior"].to_dataset()
    assert set(group.data_vars) == {*map(str, kept.data_vars), "k_mean", "beta_mean"}
    assert group["measure"].to_numpy().tolist() == list(MEASURES)
    assert group["k_case"]["case"].to_numpy().tolist() == kept["case"].to_numpy().tolist()
    of = group.sel(measure="contraction")
    assert float(of["k"].min()) > 0.99
    assert of["k_mean"].sizes == {"mean_of": 2}
    assert float(of["k_mean"].min()) > 0.99
    assert bool(of["outlier_probability"].isnull().all())
    sensitive = group.sel(measure="prior_sensitivity")
    assert bool(sensitive["k"].isnull().all())
    assert bool(sensitive["k_case"].notnull().all())


def test_what_the_data_did_not_say_is_limitationed_by_name_and_with_a_remedy(of_records):
    label = str(of_records["posterior"]["case"].to_numpy()[2])
    said = find_limitations(of_records)
    case = next(limitation for limitation in said if limitation.startswith(f"beta_case[{label}]: weakly identified"))
    assert "it needs several points within beta of the start" in case
    assert any(limitation.startswith("sd_J: weakly identified") for limitation in said)
    # Draws of the prior itself follow their prior and nothing else.
    assert any("sd_J" in limitation and "prior-sensitive" in limitation for limitation in said)
    assert identified(of_records, "sd_J")["decided_by"].tolist() == ["prior"]
    assert not any("k_case" in limitation for limitation in said)


def test_a_summary_carries_what_was_found_row_by_row(of_records):
    table = summary.summary(of_records, "pass")
    rows = table[table["parameter"] == "beta_case"].reset_index(drop=True)
    assert (rows["contraction"] < 0.5).tolist() == [False, False, True, False]
    assert table.loc[table["parameter"] == "sd_J", "decided_by"].tolist() == ["prior"]
    assert table[table["parameter"] == "k_group[single loading]"]["contraction"].item() > 0.99


def test_a_posterior_without_the_group_has_no_limitations_and_empty_columns():
    factor_table = grid(("single",))
    tree = posterior(scattered(factor_table, seed=1), factor_table)
    assert find_limitations(tree) == []
    assert summary.summary(tree, "pass")[list(MEASURES)].isna().all(axis=None)


def test_printed_tables_that_are_drawn_from_the_prior_have_no_contraction():
    printed = tables.case_means()
    factors = find_factors(printed[list(printed.columns[:5])])
    values = {"k": printed["k_kN_per_mm"].to_numpy(dtype=float), "beta": printed["beta_mm"].to_numpy(dtype=float)}
    drawn = draw_prior(published_model, {"values": values, "factors": factors}, PRIOR_SITES, 4 * 500, seed=11)
    by_chain = {name: values.reshape(4, 500, *values.shape[1:]) for name, values in drawn.items()}
    energy = {"energy": normal(1, 1), "diverging": np.zeros(SHAPE, dtype=bool)}
    tree = to_datatree(by_chain, energy, factors, record_factors(simulate(Plan(), 1)[0])[:0], {"origin": "published"})
    found = identify_published(tree, printed)[GROUP].to_dataset().sel(measure="contraction")
    # Logarithms of cells are normal: ratios of variances of 2000 and 4000 draws have a standard error of 0.039.
    assert float(np.abs(found["k_group"]).max()) < 5 * 0.039
    # Effects are normal with a half-normal scale: an excess kurtosis of 6 makes that 0.077.
    assert float(np.abs(found["log_k_speed"]).max()) < 5 * 0.077
    assert float(found["beta_case"].max()) < 0.5


def test_usual_repeats_scatter_about_their_cases_and_cases_share_their_group():
    factors = find_factors(grid(("single", "dual")))
    none = jnp.zeros((len(factors.of_record), 0))
    data = RecordData(none, none, none > 0, *3 * [jnp.ones(len(none))])
    drawn = draw_prior(records_model, {"data": data, "factors": factors, "observed": False}, PRIOR_SITES, 500, seed=1)
    usual = usual_repeats(drawn, factors, seed=2)
    z = np.log(usual["k"] / drawn["k_case"][:, factors.of_record]) / drawn["sd_log_k_repeat"][:, None]
    # 12,000 standard normal numbers: 5 standard errors.
    assert z.std() == pytest.approx(1.0, abs=5 / np.sqrt(2 * z.size))
    assert drawn["sd_log_k_repeat_by_speed"].shape == (500, 2)
    np.testing.assert_allclose(drawn["log_k_speed"].sum(axis=1), 0.0, atol=1e-12)
    # Two cases of a group share it: their logarithms differ by effects and remainders alone.
    apart = np.log(drawn["beta_case"][:, 0] / drawn["beta_case"][:, 2])
    assert apart.std() < 0.7 * np.log(drawn["beta_case"][:, 0]).std()
