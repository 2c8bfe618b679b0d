"""NUTS on many small data sets of one shape with a single compilation, one after another on every device.

Data sets run in turn (`lax.map`) and not vectorised: vectorised ones wait for the longest tree among them, and gained
nothing over taking turns. Devices work side by side, a share of the data sets each.
"""

import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import Array, ArrayLike, Float
from numpyro.handlers import trace
from numpyro.infer import NUTS

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, hyperparameter_starts, prior_sites
from bayes_tyre.inference.model.coordinates.laplace import (
    LaplaceApproximation,
    RecordEstimates,
    cases_of,
    estimate_records,
    with_traded_replaced,
)
from bayes_tyre.inference.model.likelihood import compress
from bayes_tyre.inference.model.models import records_model
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.repeat_distribution import judgeable, repeat_density
from bayes_tyre.inference.record_data import RecordData, record_data
from bayes_tyre.inference.sampling.nuts import TARGET_ACCEPTANCE, leave_resonance, start_near
from bayes_tyre.studies.design import Design

#: Data sets a device takes between two reports of progress; records that least squares takes at a time.
TURNS, ESTIMATED = 4, 1000
#: Deepest trees in warmup and after it. Deeper ones would let few data sets cost more than all others; where they are
#: wanted the draws hang together, which R-hat shows.
DEEPEST = (7, 8)
_DEVICES = "devices"


class Sampling(NamedTuple):
    """How much to sample of each data set: iterations to adapt, draws to keep, iterations from one kept to the next."""

    warmup: int = 300
    kept: int = 79
    thin: int = 5


class DataSet(NamedTuple):
    """One data set as its fit takes it; with a leading axis, many.

    Attributes
    ----------
    data, picture:
        The records, and their Gaussian picture.
    starts:
        Where the populations start, by site.
    """

    data: RecordData
    approximation: LaplaceApproximation
    starts: Mapping[str, ArrayLike]


class Sampled(NamedTuple):
    """What was sampled of each data set.

    Attributes
    ----------
    draws:
        By site, shape (sets, kept, ...); `log_likelihood` of all forces and `log_repeats` (log densities) among them.
    diverging, steps:
        Shape (sets, iterations after warmup): whether a transition diverged, and its gradients.
    energy:
        Shape (sets, iterations after warmup).
    """

    draws: dict[str, np.ndarray]
    diverging: np.ndarray
    steps: np.ndarray
    energy: np.ndarray


def observe(design: Design, force_kN: Float[np.ndarray, "sets records points"], priors: Priors = PRIORS) -> DataSet:
    """Return the data sets of a design with these forces, with a leading axis of sets."""
    sets, records, points = force_kN.shape
    estimates = _estimates(np.tile(design.u, (sets, 1)), force_kN.reshape(sets * records, points))
    estimates = jax.tree.map(lambda a: np.asarray(a).reshape(sets, records, *a.shape[1:]), estimates)
    found = []
    for i in range(sets):
        batch = design.batch(force_kN[i])
        own = with_traded_replaced(jax.tree.map(lambda a, i=i: jnp.asarray(a[i]), estimates), batch, design.factors)
        found.append(
            DataSet(
                record_data(batch),
                LaplaceApproximation(own, cases_of(own, design.factors, priors)),
                _starts(own, design.factors, priors),
            )
        )
    return jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *found)


def _estimates(u: Float[np.ndarray, "rows points"], force: Float[np.ndarray, "rows points"]) -> RecordEstimates:
    """Return the picture of each record; in lots of one size, the last filled up, so that one compilation serves."""
    rows = len(u)
    size = min(ESTIMATED, rows)
    lots = []
    for start in range(0, rows, size):
        of = np.minimum(np.arange(start, start + size), rows - 1)
        names = tuple(map(str, of))
        lots.append(estimate_records(Batch(names, u[of], force[of], np.ones((size, u.shape[1]), dtype=bool))))
    return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(leaf) for leaf in leaves])[:rows], *lots)


def _starts(records: RecordEstimates, factors: Factors, priors: Priors) -> dict[str, np.ndarray]:
    """Return where a fit of these records starts: prior medians, and where the records say more, their estimates."""
    sd_J = np.sqrt(np.mean(np.asarray(records.centre[:, 1]) ** 2)) + 1e-3
    return hyperparameter_starts(prior_sites(factors), priors.medians() | {"sd_J": np.asarray(sd_J)}, priors)


def _with_log_densities(**arguments: Any) -> None:
    """Model the records, and keep the log densities of all forces and of all repeats about their cases."""
    with trace() as sites:
        records_model(**arguments)
    numpyro.deterministic("log_likelihood", jnp.sum(sites["force"]["fn"].log_factor))
    numpyro.deterministic("log_repeats", _log_repeats(sites, arguments["factors"], arguments["priors"]))


def _log_repeats(sites: Mapping[str, Any], factors: Factors, priors: Priors) -> Array:
    """Return the log density of all repeats about their cases, of which the model has cases integrated out."""
    values = {name: jnp.asarray(site["value"]) for name, site in sites.items()}
    deviation, scatter = [], []
    for parameter in PARAMETERS:
        deviation.append(jnp.log(values[parameter] / values[f"{parameter}_case"][factors.of_record]))
        typical = f"sd_log_{parameter}_repeat"
        of_case = values[f"{typical}_by_speed"][factors.speed.of_case] if factors.speed.varies else values[typical]
        scatter.append(jnp.broadcast_to(of_case, len(factors.cases))[factors.of_record])
    of_records, scales = (jnp.stack(each, axis=1) for each in (deviation, scatter))
    return jnp.sum(
        repeat_density(
            of_records, scales, judgeable("mixture", factors), values, priors.discordant_widening
        ).log_density
    )


class SideBySide:
    """The fit of a design's records, compiled once for as many data sets as will come.

    Parameters
    ----------
    design:
        What is tested.
    sampling:
        How much to sample of each data set.
    priors:
        Of the hyperparameters.
    nominal_start:
        Whether the prior of F_i is about the nominal start of each record, as truths are drawn, or as in a fit of
        measured records about the first force.
    """

    def __init__(self, design: Design, sampling: Sampling, priors: Priors = PRIORS, nominal_start: bool = True) -> None:
        self.design, self.sampling, self.priors, self._nominal = design, sampling, priors, nominal_start
        self._model = _with_log_densities
        # More devices than cores would only take turns.
        devices = jax.local_devices()[: os.cpu_count()]
        mesh = Mesh(np.asarray(devices), (_DEVICES,))
        spec = PartitionSpec(_DEVICES)
        turns = jax.shard_map(self._turns, mesh=mesh, in_specs=(spec, spec), out_specs=spec, check_vma=False)
        self._run, self._lot = jax.jit(turns), TURNS * mesh.size

    def sample(self, sets: DataSet, key: int, on_progress: Callable[[int], None] = lambda _: None) -> Sampled:
        """Return the draws of each data set; the same sets and key give the same draws.

        Parameters
        ----------
        sets:
            As `observe` gives them.
        key:
            Of the sampler.
        on_progress:
            Called with the number of data sets just done.
        """
        count = len(sets.data.d_0)
        keys = jax.random.split(jax.random.key(key), count)
        lots = []
        for start in range(0, count, self._lot):
            # The last lot is filled up with its last data set: one shape, one compilation.
            of = np.minimum(np.arange(start, start + self._lot), count - 1)
            lot = self._run(keys[of], jax.tree.map(lambda a, of=of: jnp.asarray(a[of]), sets))
            kept = min(self._lot, count - start)
            lots.append(jax.tree.map(lambda a, kept=kept: np.asarray(a)[:kept], lot))
            on_progress(kept)
        return jax.tree.map(lambda *parts: np.concatenate(parts), *lots)

    def _arguments(self, one: DataSet) -> dict[str, Any]:
        data = jax.tree.map(jnp.asarray, one.data)
        nominal = self.design.nominal(data) if self._nominal else data
        approximation = jax.tree.map(jnp.asarray, one.approximation)
        return {
            "likelihood": compress(data),
            "data": nominal,
            "approximation": approximation,
            "factors": self.design.factors,
            "priors": self.priors,
        }

    def _turns(self, keys: Array, sets: DataSet) -> Sampled:
        return jax.lax.map(lambda turn: self._one(*turn), (keys, sets))

    def _one(self, key: Array, one: DataSet) -> Sampled:
        arguments = self._arguments(one)
        # A kernel of its own: it keeps what it was begun with, which here is being traced.
        kernel = NUTS(
            self._model,
            init_strategy=start_near(one.starts),
            target_accept_prob=TARGET_ACCEPTANCE,
            dense_mass=[tuple(one.starts)],  # pyright: ignore[reportArgumentType]
            max_tree_depth=DEEPEST,  # pyright: ignore[reportArgumentType]
        )

        def advance(state: Any, _: None) -> tuple[Any, Any]:
            state = kernel.sample(state, (), arguments)
            return state, (state.diverging, state.num_steps, state.energy)

        def to_next_kept(state: Any, _: None) -> tuple[Any, Any]:
            state, statistics = jax.lax.scan(advance, state, None, self.sampling.thin)
            return state, (state.z, statistics)

        state = kernel.init(key, self.sampling.warmup, model_kwargs=arguments)
        state = jax.lax.fori_loop(0, self.sampling.warmup, lambda _, state: advance(state, None)[0], state)
        state = leave_resonance(state)
        _, (z, statistics) = jax.lax.scan(to_next_kept, state, None, self.sampling.kept)
        draws = jax.lax.map(kernel.postprocess_fn((), arguments), z)
        named = {name: values for name, values in draws.items() if not name.endswith("_z")}
        return Sampled(named, *(values.ravel() for values in statistics))
