"""Convergence statistics of many quantities at once are those that ArviZ computes one by one."""

import arviz as az
import numpy as np
import pytest
import xarray as xr

from bayes_tyre.inference.sampling.effective_sizes import TAILS, statistics

CORRELATION = np.array([0.0, 0.5, 0.9, 0.99, -0.5, -0.9])


def awkward(chains: int, draws: int) -> np.ndarray:
    """Return chains of autoregressions; then with ties, constant, of two values, apart, stuck, and with a NaN."""
    noise = np.random.default_rng(draws).normal(size=(chains, draws, len(CORRELATION)))
    series = noise.copy()
    for i in range(1, draws):
        series[:, i] = CORRELATION * series[:, i - 1] + noise[:, i]
    plain = series[:, :, 0]
    apart = plain + np.arange(chains)[:, None]
    stuck = np.broadcast_to(np.arange(float(chains))[:, None], plain.shape)
    holed = plain.copy()
    holed[0, 0] = np.nan
    others = [np.round(series[:, :, 1]), np.ones_like(plain), plain > 1.5, apart, stuck, holed]
    return np.concatenate([series, np.stack(others, axis=2)], axis=2)


# 7 to 10 draws: the sequence of pairs ends by its length; odd ones leave a draw between the halves.
@pytest.mark.parametrize(
    ("chains", "draws"), [(4, 1500), (4, 501), (2, 170), (1, 50), (3, 4), (2, 5), (4, 7), (4, 8), (1, 9), (2, 10)]
)
def test_statistics_are_those_of_arviz(chains, draws):
    values = awkward(chains, draws)
    of_arviz = xr.DataArray(values, dims=("chain", "draw", "quantity"))
    found = statistics(values)
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = {
            "r_hat": az.rhat(of_arviz) if chains > 1 else np.full(values.shape[2], np.nan),
            "ess_bulk": az.ess(of_arviz, method="bulk"),
            "ess_tail": az.ess(of_arviz, method="tail", prob=TAILS),
            "mcse_mean": az.mcse(of_arviz, method="mean"),
        }
    for name, each in expected.items():
        np.testing.assert_allclose(getattr(found, name), each, rtol=1e-10, atol=0, err_msg=name)


def test_batches_do_not_show(monkeypatch):
    values = awkward(4, 60)
    whole = statistics(values)
    monkeypatch.setattr("bayes_tyre.inference.sampling.effective_sizes._BATCH", 500)
    for one, other in zip(statistics(values), whole, strict=True):
        np.testing.assert_array_equal(one, other)


def test_too_few_draws_have_no_statistics():
    assert np.isnan(np.stack(statistics(np.ones((4, 3, 2))))).all()
