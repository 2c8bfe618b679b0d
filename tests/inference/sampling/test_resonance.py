"""Steps with which trajectories go round and round: found, left, and once for all draws."""

import numpy as np
import numpyro
import pytest
from helpers.small_model import DATA, SETTINGS, STARTS, model
from hypothesis import given
from hypothesis import strategies as st
from numpyro import distributions as dist
from numpyro.infer.hmc import HMCState

from bayes_tyre.inference.sampling import resonance
from bayes_tyre.inference.sampling.chunks import Chunk
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import sample


@given(step=st.floats(1e-3, 2.0))
def test_a_step_off_resonance_is_hardly_longer_and_stays_where_it_is(step):
    off = float(resonance.off_resonance(step))
    assert step <= off <= 1.13 * step
    assert float(resonance.off_resonance(off)) == off
    # No tree of 8 points or more spans from half a period to little more, when its half spans little less.
    spans = off * (2.0 ** np.arange(3, resonance.DEEPEST[1]) - 1)
    assert not ((spans < np.pi) & (spans + off / 2 > np.pi)).any()


@pytest.mark.parametrize(("step", "off"), [(0.43, 7), (0.2065, 15), (0.1005, 31)])
def test_trees_of_a_step_on_resonance_go_round_and_round_and_those_off_it_do_not(step, off):
    def standard_normal() -> None:
        numpyro.sample("x", dist.Normal(0.0, 1.0).expand([400]).to_event(1))

    made = Chains(standard_normal, {}, 1, 1, {})
    begun = made.begin(0)

    def mean_steps(state: HMCState) -> float:
        return float(made.advance(state, 60).statistics["n_steps"].mean())

    on = begun._replace(adapt_state=begun.adapt_state._replace(step_size=np.array([step])), i=np.array([1]))
    assert mean_steps(on) > 2 * off
    assert mean_steps(resonance.leave_resonance(on)) == off


def test_steps_leave_resonance_once_the_warmup_has_ended(monkeypatch):
    steps: list[tuple[np.ndarray, np.ndarray]] = []
    advance = Chains.advance

    def watched(self: Chains, state: HMCState, iterations: int) -> Chunk:
        chunk = advance(self, state, iterations)
        steps.append((np.asarray(state.adapt_state.step_size), np.asarray(chunk.state.adapt_state.step_size)))
        return chunk

    monkeypatch.setattr(Chains, "advance", watched)
    monkeypatch.setattr(resonance, "off_resonance", lambda step: 1.1 * step)
    sample(model, DATA, SETTINGS, STARTS)
    # 130 and 110 iterations in chunks of 100: as it is into the last of the warmup, changed once for all draws.
    np.testing.assert_array_equal(steps[1][0], steps[0][1])
    np.testing.assert_allclose(steps[2][0], 1.1 * steps[1][1])
    for _, after in steps[2:]:
        np.testing.assert_array_equal(after, steps[2][0])
