"""Sampling chunk by chunk: NumPyro's own draws, whatever the chunks and the devices."""

import jax
import numpy as np
import pytest
from helpers.small_model import DATA, SETTINGS, STARTS, assert_same, model
from numpyro.infer import MCMC, NUTS
from numpyro.infer.util import potential_energy
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling import nuts as chains
from bayes_tyre.inference.sampling import run as sampling
from bayes_tyre.inference.sampling.run import SamplerSettings, sample


@pytest.fixture(scope="module")
def drawn() -> sampling.Draws:
    return sample(model, DATA, SETTINGS, STARTS)


def test_draws_have_chains_and_draws_first_and_deterministic_sites_too(drawn):
    assert drawn.sites["x"].shape == (2, 110, 20)
    assert drawn.sites["mu"].shape == drawn.statistics["energy"].shape == (2, 110)
    np.testing.assert_array_equal(drawn.sites["twice"], 2.0 * drawn.sites["x"])
    assert (drawn.sites["tau"] > 0).all()
    assert set(drawn.statistics) == {"diverging", "energy", "n_steps", "acceptance_rate"}
    assert not np.array_equal(drawn.sites["mu"][0], drawn.sites["mu"][1])


def test_draws_are_those_of_numpyros_own_loop(drawn):
    # Two programs round differently, and chaos makes much of it: compared from where rounding has not grown yet.
    kernel = NUTS(
        model,
        target_accept_prob=chains.TARGET_ACCEPTANCE,
        dense_mass=[("mu", "tau")],  # pyright: ignore[reportArgumentType]
    )
    few = SamplerSettings(chains=2, warmup=12, draws=8, seed=3)
    mcmc = MCMC(kernel, num_warmup=12, num_samples=8, num_chains=2, progress_bar=False)
    at = chains.Chains(model, DATA, 2, 12, STARTS).starts(3)
    mcmc.run(jax.random.key(3), init_params=at, **DATA)
    ours, theirs = sample(model, DATA, few, STARTS).sites, mcmc.get_samples(group_by_chain=True)
    for name, values in theirs.items():
        np.testing.assert_allclose(ours[name], values, rtol=1e-6, atol=1e-8, err_msg=name)


def test_normals_drawn_at_once_are_as_many_as_are_named():
    assert chains.named_normals(jax.random.PRNGKey(0), {}) == {}
    shapes = {"of_cases": (50, 40), "one": (), "of_records": (3000,)}
    z = chains.named_normals(jax.random.PRNGKey(0), shapes)
    assert {name: each.shape for name, each in z.items()} == shapes
    every = np.concatenate([np.ravel(each) for each in z.values()])
    assert len(np.unique(every)) == 5001
    # A Kolmogorov-Smirnov test that is right has a p-value below 1e-4 for one seed in ten thousand.
    assert stats.kstest(every, "norm").pvalue > 1e-4


def test_other_chunks_give_the_same_bits(drawn, monkeypatch):
    monkeypatch.setattr(sampling, "CHUNK", 37)
    assert_same(sample(model, DATA, SETTINGS, STARTS), drawn)


def test_one_device_after_another_gives_the_same_bits(drawn, monkeypatch):
    one = jax.local_devices()[:1]
    monkeypatch.setattr(jax, "local_devices", lambda *_, **__: one)
    assert_same(sample(model, DATA, SETTINGS, STARTS), drawn)


def test_other_data_of_the_same_shape_need_no_compilation(monkeypatch):
    one, other = (chains.Chains(model, data, 2, 130, STARTS) for data in (DATA, {"y": DATA["y"] + 1.0}))
    said = [each._advance.as_text() for each in (one, other)]
    assert said[0] == said[1]


def test_chains_made_for_other_data_give_the_draws_of_chains_made_for_these(drawn):
    elsewhere = chains.Chains(model, {"y": DATA["y"] + 1.0}, 2, 130, dict.fromkeys(STARTS, 2.0))
    assert_same(sampling.run(elsewhere.given(DATA, STARTS), SETTINGS), drawn)
    assert not np.array_equal(sampling.run(elsewhere, SETTINGS).sites["mu"], drawn.sites["mu"])


def test_chains_of_another_acceptance_are_compiled_once_for_all_data():
    first = chains.Chains(model, {"y": DATA["y"] + 1.0}, 2, 130, STARTS)
    ones, others = first.at_acceptance(0.9), first.given(DATA, STARTS).at_acceptance(0.9)
    assert ones._advance is others._advance
    assert ones.acceptance == others.acceptance == 0.9
    assert np.array_equal(others._data["y"], DATA["y"])


def test_progress_counts_every_iteration_of_a_chain():
    done: list[int] = []
    sample(model, DATA, SamplerSettings(chains=2, warmup=130, draws=110, seed=3, on_progress=done.append), STARTS)
    assert done == [0, 100, 30, 0, 100, 10]


@pytest.mark.parametrize(("name", "least"), [("chains", 1), ("warmup", 1), ("draws", 4), ("seed", 0)])
def test_numbers_too_small_are_refused(name, least):
    with pytest.raises(BadInput, match=f"{name} is {least - 1}; give at least {least}"):
        SamplerSettings(**{name: least - 1})


def test_steps_are_adapted_to_the_acceptance_asked_for():
    low, high = (sample(model, DATA, SETTINGS, STARTS, asked) for asked in (0.5, 0.95))
    assert high.statistics["acceptance_rate"].mean() > low.statistics["acceptance_rate"].mean() + 0.1


def test_the_potential_at_points_is_the_models_and_its_gradient_the_slope():
    made = chains.Chains(model, DATA, 2, 130, STARTS)
    points = np.stack([made.middle, made.middle + np.linspace(-0.2, 0.2, len(made.middle))])
    energies, gradients = made.potential(points)
    for point, energy in zip(points, energies, strict=True):
        sites = made.blocks.unpack(jax.tree.map(jax.numpy.asarray, made.blocks.split(point)))
        assert energy == pytest.approx(float(potential_energy(model, (), DATA, sites)), rel=1e-12)
    step = 1e-5 * np.ones_like(points)
    slope = (made.potential(points + step)[0] - made.potential(points - step)[0]) / 2e-5
    np.testing.assert_allclose(gradients.sum(axis=1), slope, rtol=1e-6)


def test_a_slope_beyond_the_model_is_in_the_potential_and_stays_at_another_acceptance():
    made = chains.Chains(model, DATA, 2, 130, STARTS)
    points = np.stack([made.middle, made.middle + np.linspace(-0.2, 0.2, len(made.middle))])
    slope = np.linspace(-1.0, 2.0, len(made.middle))
    sloping = made.given(DATA, STARTS, slope)
    (plain, gradients), (found, with_slope) = (each.potential(points) for each in (made, sloping))
    np.testing.assert_allclose(found, plain - points @ slope, rtol=1e-12)
    np.testing.assert_allclose(with_slope, gradients - slope, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(sloping.at_acceptance(0.9).potential(points)[0], found)
    np.testing.assert_array_equal(made.given(DATA, STARTS).potential(points)[0], plain)


def test_slopes_of_a_site_are_those_of_finite_differences():
    made, step = chains.Chains(model, DATA, 2, 130, STARTS), 1e-5
    draws = made.advance(made.begin(3), 7).unconstrained
    points = made.blocks.join(draws)
    found = made.slopes("squares", draws, (3, 0))
    assert found.shape == points.shape
    for unknown in range(points.shape[2]):
        off = step * np.eye(points.shape[2])[unknown]
        ends = [made.constrain(made.blocks.split(points + sign * off), (3, 0))["squares"] for sign in (1, -1)]
        differences = (ends[0] - ends[1]).reshape(2, 7, -1).sum(axis=2) / (2 * step)
        np.testing.assert_allclose(found[..., unknown], differences, rtol=1e-6, atol=1e-6)


def test_chains_that_begin_where_the_covariance_is_known_keep_its_mass_matrix_and_adapt_their_steps():
    made = chains.Chains(model, DATA, 2, 130, STARTS)
    unknowns = len(made.middle)
    root = np.eye(unknowns) + 0.1 * np.tri(unknowns, k=-1)
    state = made.begin_where(np.stack([made.middle] * 2), root @ root.T, seed=4, done=30)
    np.testing.assert_array_equal(np.asarray(state.i), 30)
    np.testing.assert_array_equal(made.blocks.join(state.z), np.stack([made.middle] * 2))
    after = made.advance(state, 100).state
    for (block,), matrix in made.blocks.inverse_mass(root @ root.T).items():
        for at in (state, after):
            np.testing.assert_array_equal(at.adapt_state.inverse_mass_matrix[(block,)], [matrix] * 2)
    assert (np.asarray(after.adapt_state.step_size) != np.asarray(state.adapt_state.step_size)).all()
    # The warmup is over: whatever the acceptance, steps stay.
    np.testing.assert_array_equal(made.advance(after, 10).state.adapt_state.step_size, after.adapt_state.step_size)


def test_more_of_a_warmup_than_its_last_chunk_adapts_the_mass_matrix_too():
    made = chains.Chains(model, DATA, 2, 400, STARTS)
    state = made.begin_where(np.stack([made.middle] * 2), np.eye(len(made.middle)), seed=4, done=150)
    for _ in range(3):
        state = made.advance(state, 100).state
    # Slow windows of a warmup of 400 end at 100, 150 and 350: one of 200 iterations is left, and then only the steps.
    for matrix in state.adapt_state.inverse_mass_matrix.values():
        assert not np.isclose(np.asarray(matrix), 1.0).any()
    later = made.advance(state, 50).state.adapt_state.inverse_mass_matrix
    for block, matrix in state.adapt_state.inverse_mass_matrix.items():
        np.testing.assert_array_equal(matrix, later[block])


def test_devices_of_a_host_share_the_data():
    made = chains.Chains(model, DATA, 2, 130, STARTS)
    shards = made._data["y"].addressable_shards
    assert len(shards) == 2
    assert len({shard.data.unsafe_buffer_pointer() for shard in shards}) == 1
    np.testing.assert_array_equal(made._data["y"], DATA["y"])


def test_draws_are_constrained_alike_however_many_at_once(monkeypatch):
    few = chains.Chains(model, DATA, 2, 130, STARTS)
    chunk = few.advance(few.begin(3), 40)
    expected = few.constrain(chunk.unconstrained, (3, 0))
    monkeypatch.setattr(chains, "_NORMALS_AT_ONCE", -1)
    one_by_one = chains.Chains(model, DATA, 2, 130, STARTS).constrain(chunk.unconstrained, (3, 0))
    for name, values in expected.items():
        np.testing.assert_allclose(one_by_one[name], values, rtol=1e-12, err_msg=name)
