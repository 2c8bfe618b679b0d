"""NUTS chains in parallel, advanced a chunk of iterations at a time by one compiled function.

NumPyro's own loop compiles a whole run into one call, which cannot be watched or resumed. Here one call runs a chunk,
of warmup or draws alike, because the adaptation follows the iteration number in the state. It is compiled once, and a
run that is stopped and resumed from its state gives the same bits as one that was not.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpyro import handlers
from numpyro.distributions import biject_to
from numpyro.infer.hmc import HMCState, hmc
from numpyro.infer.hmc_util import build_adaptation_schedule
from numpyro.infer.initialization import init_to_feasible
from numpyro.infer.util import constrain_fn, potential_energy

from bayes_tyre.inference.sampling.chain_devices import ChainDevices
from bayes_tyre.inference.sampling.chunks import CHUNK, Chunk, draw_keys, joined, named_normals
from bayes_tyre.inference.sampling.parameter_vector import DENSE, Blocks
from bayes_tyre.inference.sampling.resonance import DEEPEST
from bayes_tyre.runtime import RUN_ONCE, return_freed_memory, run_often

#: About the best of Hoffman and Gelman (2014, The No-U-Turn Sampler). Stan and NumPyro take 0.8 for models with necks;
#: in the coordinates of `bayes_tyre.inference.model.coordinates` none is left that would need shorter steps.
TARGET_ACCEPTANCE = 0.65
#: For motions, whose posteriors bend, one by itself and a few in a hierarchy: with longer steps one trajectory of a
#: few thousand diverged. For the collapsed sampler too, which walks over little else than standard deviations.
CAREFUL_ACCEPTANCE = 0.8
#: Standard deviation of the starts about the values given; half the range of the others. All unconstrained.
START_SD, START_RADIUS = 0.2, 0.5
#: Starts tried before one at which the density is zero is handed to the sampler all the same.
_STARTS_TRIED = 20
#: Fields of NumPyro's state by ArviZ's name.
STATISTICS = {"diverging": "diverging", "energy": "energy", "n_steps": "num_steps", "acceptance_rate": "accept_prob"}
#: Draws of each chain that are constrained in a call; and at once within it, divisors of that: the first that need no
#: more normals than this. All at once takes longer, and gigabytes where records are in thousands.
_IN_A_CALL, _DRAWS_AT_ONCE, _NORMALS_AT_ONCE = 20, (10, 5, 2, 1), 150_000
#: Most normals of a draw at which what begins the chains is compiled as what runs once.
_SMALL = 15_000


class Chains:
    """The chains of a NumPyro model, each on a device of its own where there are enough, otherwise in turns.

    Vectorised chains would wait for the longest tree and were five times slower. JAX arrays among the arguments are
    handed to the compiled functions, so that other data of the same shapes need no compilation; everything else, NumPy
    arrays too, is part of them.

    Parameters
    ----------
    model, arguments:
        The model, and its keyword arguments.
    chains, warmup:
        Number of chains; iterations of each to adapt.
    starts:
        Unconstrained values near which the sites of the hyperparameters start. These, correlated, share one dense block
        of the mass matrix.
    acceptance:
        Mean acceptance that steps are adapted to.
    """

    def __init__(
        self,
        model: Callable[..., None],
        arguments: Mapping[str, Any],
        chains: int,
        warmup: int,
        starts: Mapping[str, Any],
        acceptance: float = TARGET_ACCEPTANCE,
    ) -> None:
        self.chains, self._warmup = chains, warmup
        data, self._fixed = eqx.partition(dict(arguments), lambda leaf: isinstance(leaf, jax.Array))
        self._model, self._starts, self.acceptance = model, starts, acceptance
        # Traced once for all that is compiled: tracing a hierarchy takes as long as compiling many a model.
        self._potential = jax.jit(self._potential_energy)
        self._init_kernel, self._sample_kernel = hmc(potential_fn_gen=lambda shared: partial(self._potential, shared))
        self._devices = ChainDevices(chains)
        self._data = self._devices.place(data)
        self._shapes, self._normals = self._find_shapes()
        self._drawn_by = {name.removesuffix("_drawn") for name in self._normals}
        self.blocks = Blocks(self._shapes, tuple(starts))
        self._slope = self._of_blocks(np.zeros(self.blocks.size))
        self._slopes = dict[str, Any]()
        self._begin, self._advance, self._constrain = self._compile_together()
        self._of_acceptance: dict[float, Chains] = {}

    def given(
        self,
        arguments: Mapping[str, Any],
        starts: Mapping[str, Any],
        slope: Float[np.ndarray, " unknowns"] | None = None,
    ) -> "Chains":
        """Return these chains, compiled as they are, of other data of the same shapes and from other starts.

        With a `slope` the log density has that along the unknowns, unconstrained, beyond what the model says.
        """
        other = copy(self)
        other._data = self._devices.place(eqx.filter(dict(arguments), lambda leaf: isinstance(leaf, jax.Array)))
        other._starts = starts
        other._slope = self._of_blocks(np.zeros(self.blocks.size) if slope is None else slope)
        return other

    def at_acceptance(self, acceptance: float) -> "Chains":
        """Return chains of the same model, data and starts that adapt to another acceptance.

        They are compiled the first time that these chains, or chains that they were `given`, are asked for them.
        """
        arguments, made = self._arguments(self._data), self._of_acceptance
        if acceptance not in made:
            made[acceptance] = Chains(self._model, arguments, self.chains, self._warmup, self._starts, acceptance)
        return made[acceptance].given(arguments, self._starts, self.blocks.join(self._slope))

    @property
    def _size(self) -> int:
        """How many normals the model draws by: some for each record."""
        return sum(math.prod(shape) for shape in self._normals.values())

    @property
    def sampled(self) -> tuple[str, ...]:
        """Names of the sites that are sampled."""
        return tuple(self._shapes)

    def begin(self, seed: int) -> HMCState:
        """Return the state before the first iteration."""
        for tried in range(_STARTS_TRIED):
            state = self._begin_at(self.blocks.pack(self.starts(seed, tried)), seed)
            if np.isfinite(np.asarray(state.potential_energy)).all():
                break
        return state

    def begin_where(
        self,
        points: Float[np.ndarray, "chains unknowns"],
        covariance: Float[np.ndarray, "unknowns unknowns"],
        seed: int,
        done: int,
    ) -> HMCState:
        """Return the state of chains at points of a posterior whose covariance is known, so much of the warmup done.

        Within its last chunk iterations adapt the step size, and keep the mass matrix that the covariance makes.
        """
        state = self._begin_at(self.blocks.split(points), seed, self.blocks.inverse_mass(covariance))
        windows = build_adaptation_schedule(self._warmup)
        within = done < self._warmup - CHUNK
        window = next(i for i, one in enumerate(windows) if one.end >= done) if within else len(windows) - 1
        adapted = state.adapt_state._replace(window_idx=jnp.full(self.chains, window))
        return state._replace(i=jnp.full(self.chains, done), adapt_state=adapted)

    def potential(self, points: Float[np.ndarray, "chains unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return the potential energy and its gradient at as many points as there are chains.

        Shapes (chains,) and (chains, unknowns).
        """
        state = self._begin_at(self.blocks.split(points), 0)
        return np.asarray(state.potential_energy), self.blocks.join(state.z_grad)

    @property
    def middle(self) -> Float[np.ndarray, " unknowns"]:
        """The point about which chains start, as `begin_where` takes them."""
        of_sites = {name: np.broadcast_to(self._starts.get(name, 0.0), shape) for name, shape in self._shapes.items()}
        return self.blocks.join(self.blocks.pack({name: values[None] for name, values in of_sites.items()}))[0]

    def starts(self, seed: int, tried: int = 0) -> dict[str, np.ndarray]:
        """Return where each chain starts, unconstrained: the sites named near their values, the others around zero."""
        random, starts = np.random.default_rng([seed, tried]), {}
        for name, shape in self._shapes.items():
            of_chains = (self.chains, *shape)
            if name in self._starts:
                starts[name] = self._starts[name] + START_SD * random.standard_normal(of_chains)
            else:
                starts[name] = random.uniform(-START_RADIUS, START_RADIUS, of_chains)
        return starts

    def advance(self, state: HMCState, iterations: int) -> Chunk:
        """Return what so many iterations, at most `CHUNK`, leave."""
        state, stored = self._devices.in_turns(self._advance, state, (self._shared, np.int64(iterations)))
        draws, statistics = jax.tree.map(lambda values: np.asarray(values)[:, :iterations], stored)
        return Chunk(state, draws, statistics)

    def constrain(self, unconstrained: Mapping[str, np.ndarray], seed: Sequence[int]) -> dict[str, np.ndarray]:
        """Return a chunk's draws of every site of the model, deterministic ones included.

        What the model draws given the sampled sites (`standard_normals`) it draws from this seed. The normals that it
        is drawn by are left out: of thousands of records they would be gigabytes that nobody asks for.
        """
        length, keys = next(iter(unconstrained.values())).shape[1], draw_keys(seed, self.chains)

        def part(start: int) -> dict[str, np.ndarray]:
            end = min(start + _IN_A_CALL, length)

            def filled(values: np.ndarray) -> np.ndarray:
                room = [(0, 0), (0, start + _IN_A_CALL - end)] + [(0, 0)] * (values.ndim - 2)
                return np.pad(values[:, start:end], room, mode="edge")

            given = jax.tree.map(filled, dict(unconstrained)), keys[:, start : start + _IN_A_CALL]
            sites = self._devices.in_turns(self._constrain, given, self._data)
            return {name: np.asarray(values)[:, : end - start] for name, values in sites.items()}

        return joined((part(start) for start in range(0, length, _IN_A_CALL)), length)

    def slopes(
        self, site: str, unconstrained: Mapping[str, np.ndarray], seed: Sequence[int]
    ) -> Float[np.ndarray, "chains draws unknowns"]:
        """Return the gradient of a site's sum along the unknowns, unconstrained, at draws of a chunk.

        What the model draws given the sampled sites is drawn from this seed, and follows them.
        """
        if site not in self._slopes:  # compiled where it is asked for: by few fits
            self._slopes[site] = self._devices.mapped(partial(self._slopes_of, site))
        keys = draw_keys(seed, self.chains)[:, : next(iter(unconstrained.values())).shape[1]]
        return self.blocks.join(self._devices.in_turns(self._slopes[site], (dict(unconstrained), keys), self._data))

    def _begin_at(
        self, vectors: Mapping[str, Any], seed: int, inverse_mass: Mapping[tuple[str], np.ndarray] | None = None
    ) -> HMCState:
        """Return the state of chains at these vectors; without inverse mass matrices, with those of variances of 1."""
        keys = jax.random.split(jax.random.PRNGKey(seed), self.chains)  # raw: a state, and its checkpoint, is arrays
        return self._devices.in_turns(self._begin, (keys, vectors, self._of_each(inverse_mass)), self._shared)

    def _of_each(self, inverse_mass: Mapping[tuple[str], np.ndarray] | None = None) -> dict[tuple[str], np.ndarray]:
        """Return inverse mass matrices, or those of variances of 1, for each chain."""
        matrices = inverse_mass or self.blocks.inverse_mass()
        return {block: np.broadcast_to(values, (self.chains, *values.shape)) for block, values in matrices.items()}

    def _find_shapes(self) -> tuple[dict[str, tuple[int, ...]], dict[str, tuple[int, ...]]]:
        """Return the shape of each sampled site, unconstrained, and of the normals that the model draws by."""
        sampled, normals = dict[str, tuple[int, ...]](), dict[str, tuple[int, ...]]()

        def look(key: jax.Array, data: Any) -> None:
            seeded = handlers.substitute(handlers.seed(self._model, key), substitute_fn=init_to_feasible())
            for name, site in handlers.trace(seeded).get_trace(**self._arguments(data)).items():
                if site["type"] == "sample" and not site["is_observed"]:
                    sampled[name] = biject_to(site["fn"].support).inverse_shape(site["fn"].shape())
                elif site["type"] == "param":
                    normals[name] = site["value"].shape

        jax.eval_shape(look, jax.random.PRNGKey(0), self._data)
        return sampled, normals

    def _compile_together(self) -> list[Callable[[Any, Any], Any]]:
        """Return what begins, advances and constrains, compiled in parallel: half of the time of a run."""
        begin, advance, constrain = map(self._devices.mapped, (self._init, self._sample, self._constrained))
        keys = jax.eval_shape(lambda: jax.random.split(jax.random.PRNGKey(0), self.chains))
        fresh = keys, self.blocks.pack(self.starts(0)), self._of_each()
        # The kernel's own closures are made as it is traced, which a continued run does nowhere else.
        self.shapes: HMCState = jax.eval_shape(begin, fresh, self._shared)

        def together(leaf: Any, *within: int) -> jax.ShapeDtypeStruct:
            return jax.ShapeDtypeStruct((self._devices.together, *within, *leaf.shape[1:]), leaf.dtype)

        state = jax.tree.map(together, self.shapes)
        draws = jax.tree.map(lambda leaf: together(leaf, _IN_A_CALL), self.shapes.z)
        with ThreadPoolExecutor() as pool:
            # What takes longest first, and each as soon as it is lowered.
            lowered = advance.lower(state, (self._shared, np.int64(0)))
            advancing = pool.submit(lowered.compile, compiler_options=run_often())
            lowered = begin.lower(jax.tree.map(together, fresh), self._shared)
            # It looks for the mode too: hundreds of gradients, which of many records take longer than to compile.
            beginning = pool.submit(lowered.compile, compiler_options=RUN_ONCE if self._size <= _SMALL else run_often())
            keys = jax.ShapeDtypeStruct((self._devices.together, _IN_A_CALL, 2), np.uint32)
            lowered = constrain.lower((draws, keys), self._data)
            constraining = pool.submit(lowered.compile, compiler_options=run_often())
        compiled = [compiling.result() for compiling in (beginning, advancing, constraining)]
        return_freed_memory()
        return compiled

    @property
    def _shared(self) -> tuple[Any, dict[str, jax.Array]]:
        """What the potential energy is of, beside the unknowns: the data, and the slope beyond the model."""
        return self._data, self._slope

    def _of_blocks(self, unknowns: Float[np.ndarray, " unknowns"]) -> dict[str, jax.Array]:
        return self._devices.place(self.blocks.split(unknowns))

    def _potential_energy(self, shared: tuple[Any, dict[str, jax.Array]], z: dict[str, jax.Array]) -> jax.Array:
        data, slope = shared
        of_model = potential_energy(self._model, (), self._arguments(data), self.blocks.unpack(z))
        return jnp.asarray(of_model) - sum(slope[block] @ z[block] for block in z)

    def _init(
        self, fresh: tuple[jax.Array, dict[str, jax.Array], dict[tuple[str], jax.Array]], shared: Any
    ) -> HMCState:
        key, start, inverse_mass = fresh
        return self._init_kernel(
            start,
            self._warmup,
            inverse_mass_matrix=dict(inverse_mass),  # a copy: the kernel changes it
            dense_mass=[(DENSE,)] if DENSE in start else [],  # pyright: ignore[reportArgumentType]
            target_accept_prob=self.acceptance,
            max_tree_depth=DEEPEST,  # pyright: ignore[reportArgumentType]
            model_args=(shared,),
            rng_key=jax.random.split(key)[0],  # as NumPyro's own kernel does: the draws are then the same
        )

    def _sample(self, state: HMCState, shared_and_iterations: tuple[Any, jax.Array]) -> Any:
        shared, iterations = shared_and_iterations

        def step(i: jax.Array, so_far: tuple[HMCState, Any]) -> tuple[HMCState, Any]:
            state = self._sample_kernel(so_far[0], (shared,))
            return state, jax.tree.map(
                lambda stored, one: stored.at[i].set(one), so_far[1], _draw_and_statistics(state)
            )

        room = jax.tree.map(lambda one: jnp.zeros((CHUNK, *one.shape), one.dtype), _draw_and_statistics(state))
        return jax.lax.fori_loop(0, iterations, step, (state, room))

    def _constrained(self, unconstrained_and_keys: tuple[dict[str, jax.Array], jax.Array], data: Any) -> Any:
        def one(z: dict[str, jax.Array], key: jax.Array) -> dict[str, jax.Array]:
            return {name: values for name, values in self._sites(z, key, data).items() if name not in self._drawn_by}

        at_once = next((n for n in _DRAWS_AT_ONCE if n * self._size <= _NORMALS_AT_ONCE), _DRAWS_AT_ONCE[-1])
        # Not by `batch_size` of `jax.lax.map`, which cannot take a site without elements.
        parts = jax.tree.map(lambda a: a.reshape(-1, at_once, *a.shape[1:]), unconstrained_and_keys)
        sites = jax.lax.map(lambda part: jax.vmap(one)(*part), parts)
        return jax.tree.map(lambda a: a.reshape(_IN_A_CALL, *a.shape[2:]), sites)

    def _slopes_of(
        self, site: str, unconstrained_and_keys: tuple[dict[str, jax.Array], jax.Array], data: Any
    ) -> dict[str, jax.Array]:
        def total(z: dict[str, jax.Array], key: jax.Array) -> jax.Array:
            return jnp.sum(self._sites(z, key, data)[site])

        return jax.lax.map(lambda each: jax.grad(total)(*each), unconstrained_and_keys)

    def _sites(self, z: dict[str, jax.Array], key: jax.Array, data: Any) -> dict[str, jax.Array]:
        """Return every site of a draw, deterministic ones included."""
        model = handlers.substitute(self._model, data=named_normals(key, self._normals))
        return constrain_fn(model, (), self._arguments(data), self.blocks.unpack(z), return_deterministic=True)

    def _arguments(self, data: Any) -> Any:
        return eqx.combine(data, self._fixed)


def _draw_and_statistics(state: HMCState) -> tuple[Any, dict[str, Any]]:
    return state.z, {name: getattr(state, field) for name, field in STATISTICS.items()}
