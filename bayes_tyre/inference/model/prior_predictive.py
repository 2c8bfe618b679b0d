"""What the priors alone say: every quantity of a model, and whole records, drawn down the hierarchy with no data."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpyro.infer import Predictive

from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.likelihood.force_distribution import draw_forces
from bayes_tyre.inference.record_data import EQUATION_2, RecordData
from bayes_tyre.runtime import RUN_ONCE

#: Draws of the prior by name, shape (draws, ...).
PriorDraws = dict[str, np.ndarray]


def draw_prior(
    model: Callable[..., None], arguments: Mapping[str, Any], sites: Collection[str], draws: int, seed: int
) -> PriorDraws:
    """Return independent draws of a model's sites from its priors alone, jointly: cases share their effects.

    Parameters
    ----------
    model, arguments:
        A NumPyro model of this package, and its keyword arguments. What it observes counts for nothing.
    sites:
        Names of those wanted; names that the model has not are passed over.
    draws, seed:
        How many; the same seed gives the same ones.
    """
    # Arrays are handed to what is compiled: other records of the same shapes find it in the cache.
    data, fixed = eqx.partition(dict(arguments), lambda leaf: isinstance(leaf, jax.Array))

    @partial(jax.jit, compiler_options=RUN_ONCE)
    def drawn(key: Array, data: Any) -> dict[str, Array]:
        given = partial(model, **eqx.combine(data, fixed))
        return Predictive(given, num_samples=draws, return_sites=list(sites), parallel=True)(key)

    return {name: np.asarray(values) for name, values in drawn(jax.random.PRNGKey(seed), data).items()}


def usual_repeats(drawn: PriorDraws, factors: Factors, seed: int, parameters: Sequence[str] = PARAMETERS) -> PriorDraws:
    """Return records' values about their drawn cases as if all of them were usual repeats with the typical scatter.

    Discordant repeats, and the spread of scatter over speeds, have tails without a variance: what the prior allows is
    wider still.
    """
    rng, values = np.random.default_rng(seed), {}
    for name in parameters:
        case = drawn[f"{name}_case"][:, factors.of_record]
        values[name] = case * np.exp(drawn[f"sd_log_{name}_repeat"][:, None] * rng.standard_normal(case.shape))
    return values


def without_points(data: RecordData) -> RecordData:
    """Return the records with where they start and how far they go alone: nothing to draw forces at."""
    return data._replace(u=data.u[:, :0], F=data.F[:, :0], present=data.present[:, :0])


def prior_forces(
    drawn: PriorDraws, record: int, displacement_mm: Float[np.ndarray, " points"], seed: int, law: str = EQUATION_2
) -> Float[np.ndarray, "draws points"]:
    """Return the forces (kN) of a record in each draw of the prior, noise of each point included.

    Parameters
    ----------
    drawn:
        Of `bayes_tyre.inference.model.models.records_model`.
    record, displacement_mm:
        Which record, and where its points shall be.
    seed, law:
        Of the noise; and of `bayes_tyre.inference.record_data.LAWS`.
    """
    names = ("F_i", "J", "k", "beta", "sigma", *(["rho"] if "rho" in drawn else []))
    values = [jnp.asarray(drawn[name][:, record, None]) for name in names]
    draws = len(values[0])
    u = jnp.broadcast_to(jnp.asarray(displacement_mm - displacement_mm[0]), (draws, len(displacement_mm)))
    nu = jnp.asarray(drawn["noise_nu"]) if "noise_nu" in drawn else None
    return np.asarray(_draw_forces(u, values, nu, jax.random.PRNGKey(seed), law))


@partial(jax.jit, static_argnames="law")
def _draw_forces(
    u: Float[Array, "draws points"],
    values: list[Float[Array, "draws 1"]],
    nu: Float[Array, " draws"] | None,
    key: Array,
    law: str,
) -> Float[Array, "draws points"]:
    """Draw forces of as many records as there are draws."""
    F_i, J, k, beta, sigma, *rho = values
    theta = jnp.concatenate([F_i, J, jnp.log(k), jnp.log(beta)], axis=1)
    return draw_forces(key, u, theta, sigma[:, 0], rho[0][:, 0] if rho else None, law, nu)
