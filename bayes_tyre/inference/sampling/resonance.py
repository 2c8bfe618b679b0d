"""Steps of the sampler with which no trajectory goes round and round a normal posterior."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float
from numpyro.infer.hmc import HMCState

#: Deepest trees while adapting, and after. Before the mass matrix is known every tree grows to its limit: at 10, the
#: first hundred iterations took nine tenths of all the time.
DEEPEST = (6, 10)
#: Margins below the first and above the last of the steps that `off_resonance` avoids: leapfrog's period is not quite
#: that of the motion, and no mass matrix is exact.
_RESONANT = (0.985, 1.035)
#: Points of the smallest tree whose resonance is avoided. Of four points it lies at steps of 0.9 to 1.05, which no
#: posterior of hundreds of unknowns accepts.
_FEWEST_POINTS = 8


def off_resonance(step_size: ArrayLike) -> Float[np.ndarray, "..."]:
    """Return steps of which no tree of eight points or more goes round and round.

    Where the posterior is a standard normal, motion has a period of 2 pi. A tree of 2^j points that spans just less
    than half of it has not turned back yet; doubled it spans just more than the whole, seems not to have turned either,
    and is doubled again, and again, until rounding the circle has put it out of phase. NumPyro's criterion shares that
    with Stan's up to 2.20 (stan-dev/stan, issue 2799). Such steps are lengthened by up to an eighth; others are
    returned as they are.
    """
    points = 2.0 ** np.arange(np.log2(_FEWEST_POINTS), DEEPEST[1])
    shortest, longest = _RESONANT[0] * np.pi / (points - 0.5), _RESONANT[1] * np.pi / (points - 1)
    step = np.asarray(step_size)
    resonant = (step[..., None] > shortest) & (step[..., None] < longest)
    return np.asarray(np.maximum(step, np.max(np.where(resonant, longest, 0.0), axis=-1)))


def leave_resonance(state: HMCState) -> HMCState:
    """Return the state after the last iteration of the warmup with its steps `off_resonance`."""
    adapted = state.adapt_state
    return state._replace(adapt_state=adapted._replace(step_size=jnp.asarray(off_resonance(adapted.step_size))))
