"""The shipped sampler on many small data sets of one design, compiled once."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.coordinates.laplace import (
    LaplaceApproximation,
    RecordEstimates,
    cases_of,
    empty_approximation,
    estimate_records,
    with_traded_replaced,
)
from bayes_tyre.inference.model.coordinates.sites import record_starts, records_in_coordinates
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_batch
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import SamplerSettings, run
from bayes_tyre.studies.design import Design
from bayes_tyre.studies.ranked_quantities import Hierarchy, log_likelihood_of_records
from bayes_tyre.studies.truths import Planted, Truths, draw_truths

#: Records that least squares takes at a time.
ESTIMATED = 1000


class Thinned(NamedTuple):
    """How much to sample of each data set.

    Attributes
    ----------
    settings:
        Of the sampler, as any fit takes them.
    thin:
        Iterations from one draw that is kept to the next.
    draws:
        As many draws of all chains together.
    """

    settings: SamplerSettings = SamplerSettings(chains=2, warmup=300, draws=200)
    thin: int = 5
    draws: int = 79


class Sampled(NamedTuple):
    """What was sampled of each data set.

    Attributes
    ----------
    draws:
        By site, shape (sets, draws, ...), one chain after the other.
    diverging, steps, energy:
        Shape (sets, chains, iterations after warmup): whether a transition diverged, its gradients, its energy.
    """

    draws: dict[str, np.ndarray]
    diverging: np.ndarray
    steps: np.ndarray
    energy: np.ndarray


class SimulatedSets(NamedTuple):
    """Data sets of known truth, and what was sampled of each.

    Attributes
    ----------
    truths, sampled:
        True values by name, shape (sets, ...), and draws.
    of_records:
        Log density of the readings of each record at truths and at draws: shapes (sets, records) and (sets, draws,
        records).
    """

    truths: Truths
    sampled: Sampled
    of_records: tuple[np.ndarray, np.ndarray]


def sample_thinned(chains: Chains, sampling: Thinned, seed: int) -> Sampled:
    """Return draws of one data set, by site of shape (draws, ...), and the statistics of its chains."""
    settings, thin, draws = sampling
    drawn = run(chains, replace(settings, seed=seed))
    every = {
        name: np.concatenate(values[:, thin - 1 :: thin])[:draws]
        for name, values in drawn.sites.items()
        if not name.endswith("_z")
    }
    return Sampled(every, *(drawn.statistics[name] for name in ("diverging", "n_steps", "energy")))


def sample_each(of_sets: Iterable[Chains], sampling: Thinned, seed: int, on_progress: Callable[[int], None]) -> Sampled:
    """Return draws of each data set from its chains; the seed is that of the first, the others have those that follow.

    `on_progress` is called with the number of data sets just done.
    """
    sets = []
    for i, chains in enumerate(of_sets):
        sets.append(sample_thinned(chains, sampling, seed + i))
        on_progress(1)
    return jax.tree.map(lambda *parts: np.stack(parts), *sets)


class DesignFit:
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
    noise:
        ``iid``, ``ar1`` or ``student``.
    """

    def __init__(
        self,
        design: Design,
        sampling: Thinned | None = None,
        priors: Priors = PRIORS,
        nominal_start: bool = True,
        noise: str = "iid",
    ) -> None:
        self.design, self.sampling, self.nominal_start = design, sampling or Thinned(), nominal_start
        self.model = ModelSettings(priors=priors, noise=noise)
        blank = self._arguments(np.zeros(design.u.shape))
        approximation = empty_approximation(len(design.factor_table), design.factors)
        settings = self.sampling.settings
        arguments = {"approximation": approximation, **blank}
        self._chains = Chains(records_in_coordinates, arguments, settings.chains, settings.warmup, record_starts(blank))

    def approximations(self, force_kN: Float[np.ndarray, "sets records points"]) -> list[LaplaceApproximation]:
        """Return the Laplace approximation of each data set's records, least squares taking many sets together."""
        if self.model.noise == "student":  # each with weights of its own, which least squares together have not
            return [self._records(force).approximation(self.model) for force in force_kN]
        sets, records, points = force_kN.shape
        noise = self.model.noise
        together = _estimates(np.tile(self.design.u, (sets, 1)), force_kN.reshape(sets * records, points), noise)
        approximations = []
        for i in range(sets):
            here = slice(i * records, (i + 1) * records)
            own = RecordEstimates(*(jnp.asarray(values[here]) for values in together))
            own = with_traded_replaced(own, self.design.batch(force_kN[i]), self.design.factors, noise)
            approximations.append(LaplaceApproximation(own, cases_of(own, self.design.factors, self.model.priors)))
        return approximations

    def sample(
        self,
        force_kN: Float[np.ndarray, "sets records points"],
        approximations: list[LaplaceApproximation],
        seed: int,
        on_progress: Callable[[int], None] = lambda _: None,
    ) -> Sampled:
        """Return draws of each data set.

        Parameters
        ----------
        force_kN, approximations:
            The data sets, and what `approximations` gives of them.
        seed:
            Of the first data set; the others have those that follow.
        on_progress:
            Called with the number of data sets just done.
        """
        each = (self._chains_of(*one) for one in zip(force_kN, approximations, strict=True))
        return sample_each(each, self.sampling, seed, on_progress)

    @property
    def hierarchy(self) -> Hierarchy:
        """What is above the records."""
        sites = prior_sites(self.design.factors, self.model.repeats, self.model.correlation)
        return Hierarchy(self.design.factors, self.model.priors, sites)

    def simulated(
        self, sets: int, of_truths: int, of_sampler: int, planted: Planted, on_progress: Callable[[int], None]
    ) -> SimulatedSets:
        """Return data sets drawn from the priors and what was sampled of each, as `calibrate` asks for them."""
        design = self.design
        truths, force = draw_truths(design, sets, of_truths, self.model.priors, planted, self.model.noise)
        sampled = self.sample(force, self.approximations(force), of_sampler, on_progress)
        at_truths = log_likelihood_of_records(design, truths, force)
        at_draws = log_likelihood_of_records(design, sampled.draws, force[:, None])
        return SimulatedSets(truths, sampled, (at_truths, at_draws))

    def _chains_of(self, force_kN: Float[np.ndarray, "records points"], approximation: LaplaceApproximation) -> Chains:
        arguments = self._arguments(force_kN)
        starts = record_starts(arguments, approximation.records)
        return self._chains.given({"approximation": approximation, **arguments}, starts)

    def _arguments(self, force_kN: Float[np.ndarray, "records points"]) -> dict[str, Any]:
        return self._records(force_kN).arguments(self.model)

    def _records(self, force_kN: Float[np.ndarray, "records points"]) -> PreparedRecords:
        design = self.design
        records = prepare_batch(design.batch(force_kN), design.factor_table, design.factors, self.model)
        if not self.nominal_start:
            return records
        data, likelihood = design.nominal(records.data), records.likelihood
        if isinstance(likelihood, StudentLikelihood):  # its offsets, too, are about where the prior is
            likelihood = replace(likelihood, data=data)
        return records._replace(data=data, likelihood=likelihood)


def _estimates(
    u: Float[np.ndarray, "rows points"], force: Float[np.ndarray, "rows points"], noise: str
) -> RecordEstimates:
    """Return the estimates of each record; in lots of one size, the last filled up, so that one compilation serves."""
    rows = len(u)
    size = min(ESTIMATED, rows)
    lots = []
    for start in range(0, rows, size):
        of_lot = np.minimum(np.arange(start, start + size), rows - 1)
        names = tuple(map(str, of_lot))
        everywhere = np.ones((size, u.shape[1]), dtype=bool)
        lots.append(estimate_records(Batch(names, u[of_lot], force[of_lot], everywhere), noise))
    return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(leaf) for leaf in leaves])[:rows], *lots)
