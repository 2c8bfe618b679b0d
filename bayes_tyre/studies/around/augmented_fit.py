"""A user's records and as many new ones of the same tests, fitted together: compiled once for many sets of new ones."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.batch import Batch
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import whitening_of
from bayes_tyre.inference.model.coordinates.sites import record_starts
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, apart_weight
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_with_noise
from bayes_tyre.inference.model.repeat_distribution import judgeable
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import joint_chains
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.studies.design_fit import Sampled, Thinned, sample_each

#: What the name of a new record ends with.
NEW = " new"


def augmented_model(records: PreparedRecords, model: ModelSettings) -> ModelSettings:
    """Return the options with which twice as many repeats are the model that the records alone were fitted with.

    Whether repeats can be discordant, and cases stand apart, stays as it was.

    Raises
    ------
    BadInput
        For one record: the noise of several has parameters that its own has not; and for Student-t noise.
    """
    if model.noise == "student":
        raise BadInput(
            "was fitted with noise student, which --around does not simulate; fit with another noise, or run study "
            "calibration --noise student"
        )
    if len(records.batch.records) == 1:
        raise BadInput(
            "holds one record, and the noise of two has a distribution that one has not; fit several records"
        )
    priors = model.priors
    if not apart_weight(records.factors, PARAMETERS, priors):
        priors = priors.changed({"apart_weight": 0.0})
    return replace(model, repeats=judgeable(model.repeats, records.factors), priors=priors)


def augmented(
    records: PreparedRecords, new_force_kN: Float[np.ndarray, "records points"], model: ModelSettings
) -> PreparedRecords:
    """Return the records, and new ones of the same tests with these forces (kN) after them.

    The prior of F_i of each new record, and how its noise differs from point to point, are those of the record that it
    repeats, not estimated again.
    """
    batch, twice = records.batch, np.tile(np.arange(len(records.batch.records)), 2)
    names = (*batch.records, *(f"{name}{NEW}" for name in batch.records))
    force = np.concatenate([batch.force_kN, new_force_kN])
    both = Batch(names, batch.displacement_mm[twice], force, batch.present[twice])
    factor_table = records.factor_table.iloc[twice].assign(record=names).reset_index(drop=True)
    whitening = None if records.whitening is None else whitening_of(records.whitening, twice)
    made = prepare_with_noise(both, both, factor_table, records.factors.only(twice), whitening, model)
    F_0, span = (jnp.asarray(np.asarray(values)[twice]) for values in (records.data.F_0, records.data.span))
    return made._replace(data=made.data._replace(F_0=F_0, span=span))


def log_likelihoods(likelihood: Likelihood, values: Mapping[str, np.ndarray]) -> Float[np.ndarray, "draws records"]:
    """Return the log density of the forces of each record at draws of its parameters."""
    return np.asarray(_log_likelihoods(likelihood, {name: jnp.asarray(each) for name, each in values.items()}))


@eqx.filter_jit
def _log_likelihoods(likelihood: Likelihood, values: Mapping[str, Array]) -> Float[Array, "draws records"]:
    def of_draw(draw: Mapping[str, Array]) -> Float[Array, " records"]:
        theta = jnp.stack([draw["F_i"], draw["J"], jnp.log(draw["k"]), jnp.log(draw["beta"])], axis=1)
        return likelihood(theta, draw["sigma"], draw.get("rho"))

    return jax.vmap(of_draw)(values)


class AugmentedFit:
    """The joint fit of a user's records and of new ones, in the model that the user's records alone were fitted with.

    Parameters
    ----------
    records, model:
        The user's records as they were fitted, and the options of that fit.
    sampling:
        How much to sample of each set.

    Raises
    ------
    BadInput
        For one record.
    """

    def __init__(self, records: PreparedRecords, model: ModelSettings, sampling: Thinned | None = None) -> None:
        self.records, self.sampling = records, sampling or Thinned()
        self.model = augmented_model(records, model)
        blank = self.augmented(records.batch.force_kN)
        self.factors = blank.factors
        self._chains = joint_chains(blank, self.sampling.settings, self.model)

    def augmented(self, new_force_kN: Float[np.ndarray, "records points"]) -> PreparedRecords:
        """Return the records and new ones with these forces (kN) after them."""
        return augmented(self.records, new_force_kN, self.model)

    def sample(
        self,
        new_force_kN: Float[np.ndarray, "sets records points"],
        seed: int,
        on_progress: Callable[[int], None] = lambda _: None,
    ) -> Sampled:
        """Return draws of each set; the user's records come first. `seed` is that of the first set."""
        each = (self._chains_of(force) for force in new_force_kN)
        return sample_each(each, self.sampling, seed, on_progress)

    def _chains_of(self, new_force_kN: Float[np.ndarray, "records points"]) -> Chains:
        records = self.augmented(new_force_kN)
        arguments, approximation = records.arguments(self.model), records.approximation(self.model)
        starts = record_starts(arguments, approximation.records)
        return self._chains.given({"approximation": approximation, **arguments}, starts)
