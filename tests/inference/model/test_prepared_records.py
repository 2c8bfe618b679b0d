"""Records as the model takes them: the error of the mass that was taken off is one that a record's points share."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import SharedError
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.prepared_records import prepare_records, record_batch
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record_table import check_record_table

PLAN = Plan(speeds=(0.0, 15.0), repeats=12)
SD_KG = 6.0


def with_masses_off(seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return records from which a wrong mass was taken off, a draw each, the columns that say so, and the truth."""
    table, truth = simulate(PLAN, seed)
    phase = table.groupby("record").cumcount() / (PLAN.points - 1)
    # Pushed, then slowed down: up to 20 N a kilogram, as in the records of `process`.
    per_kg = -0.02 * np.sign(table["step_kN"]) * np.cos(np.pi * phase)
    per_kg[phase == 0] = 0.0
    kg = dict(zip(truth["record"], np.random.default_rng(seed).normal(0, SD_KG, len(truth)), strict=True))
    force = table["force_kN"] + table["record"].map(kg) * per_kg
    table = table.assign(force_kN=force, force_per_kg_kN=per_kg, mass_sd_kg=SD_KG)
    return check_record_table(table), truth.set_index("record")


def z_of_log_k(table: pd.DataFrame, truth: pd.DataFrame) -> np.ndarray:
    """Return how many of its standard errors each record's estimate of log k is off."""
    records = prepare_records(table, ModelSettings())
    estimates = estimate_records(records.batch, whitening=records.whitening)
    sd = jnp.sqrt(jnp.linalg.inv(estimates.information)[:, 2, 2])
    return (estimates.centre[:, 2] - np.log(truth.loc[list(records.batch.records), "k"].to_numpy())) / np.asarray(sd)


def test_the_error_of_a_mass_is_in_the_standard_error_of_k():
    """192 records: the mean square of standard normal numbers is outside 0.72 to 1.32 with probability 3e-3."""
    table, truth = with_masses_off(3)
    assert 0.72 < np.mean(z_of_log_k(table, truth) ** 2) < 1.32
    unknown = z_of_log_k(table.drop(columns="mass_sd_kg"), truth)
    assert np.mean(unknown**2) > 3.0


def test_where_nothing_is_known_of_the_mass_nothing_changes():
    table, _ = with_masses_off(3)
    assert record_batch(table.drop(columns="force_per_kg_kN")).force_error_kN is None
    assert record_batch(table.assign(mass_sd_kg=0.0)).force_error_kN is None
    some = table.assign(mass_sd_kg=table["mass_sd_kg"].where(table["repeat"] > 1))
    batch = record_batch(some)
    assert batch.force_error_kN is not None
    first = np.array([name.endswith("(1)") for name in batch.records])
    assert not batch.force_error_kN[first].any()
    assert batch.force_error_kN[~first].any(axis=1).all()
    kept = batch.only(~first)
    np.testing.assert_array_equal(kept.force_error_kN, batch.force_error_kN[~first])


def test_a_mass_that_is_no_number_is_refused():
    table, _ = with_masses_off(3)
    with pytest.raises(BadInput, match=r"columns force_per_kg_kN and mass_sd_kg: .*heavy.*; mend the cell or remove"):
        prepare_records(table.assign(mass_sd_kg="heavy"), ModelSettings())


def test_some_of_the_records_have_the_noise_that_all_of_them_show():
    table, _ = with_masses_off(3)
    records = prepare_records(table, ModelSettings())
    some = np.arange(len(records.batch.records)) % 5 == 0
    whole, part = records.whitening, records.only(some, ModelSettings()).whitening
    assert isinstance(whole, SharedError)
    assert isinstance(part, SharedError)
    for own, of_all in zip(jax.tree.leaves(part), jax.tree.leaves(whole), strict=True):
        np.testing.assert_array_equal(own, of_all[some])
    independent = ModelSettings(noise_window=5)
    smoothed = prepare_records(table, independent)
    assert smoothed.only(some, independent).whitening is smoothed.whitening
