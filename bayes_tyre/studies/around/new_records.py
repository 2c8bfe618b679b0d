"""New records of a user's own tests, drawn from a posterior: the same displacements, cases and repeats once more.

Written in NumPy, from the documentation of the model: ranks that are uniform say that the model which is fitted is this
one.
"""

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Bool, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import Whitening
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, prior_sites
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import LAWS
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import PROBABILITIES, QUANTITIES
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.studies.ranked_quantities import centre_of_records, sd_of_records
from bayes_tyre.studies.truths import NOTHING, Planted, Truths


def posterior_truths(tree: xr.DataTree, records: PreparedRecords, model: ModelSettings, sets: int) -> Truths:
    """Return draws of a posterior, evenly spaced among all that hold its records, as truths by name.

    Probabilities that a draw implies of its records and cases are no parameters, and left out.

    Parameters
    ----------
    tree:
        The posterior.
    records, model:
        What it was fitted to, and the options of the fit.
    sets:
        How many draws.

    Raises
    ------
    BadInput
        If the posterior is of other records or of another model, or has fewer draws.
    """
    posterior = as_measured(with_records(tree))
    if [str(name) for name in posterior["record"].to_numpy()] != list(records.batch.records):
        raise BadInput("the posterior is not of the records that were its input; run fit again")
    sites = prior_sites(records.factors, model.repeats, model.correlation)
    if lacks := [site for site in sites if site not in posterior]:
        raise BadInput(f"the posterior has no {lacks[0]}, as that of an earlier version; run fit again")
    draws = posterior.sizes["chain"] * posterior.sizes["draw"]
    if sets > draws:
        raise BadInput(f"{sets} data sets are asked for, and the posterior has {draws} draws; give at most {draws}")
    chosen = np.linspace(0, draws - 1, sets).round().astype(int)
    names = [str(name) for name in posterior.data_vars if name in QUANTITIES and name not in PROBABILITIES]
    return {name: posterior[name].to_numpy().reshape(draws, *posterior[name].shape[2:])[chosen] for name in names}


def draw_new_records(
    records: PreparedRecords, model: ModelSettings, truths: Truths, rng: np.random.Generator, planted: Planted = NOTHING
) -> tuple[Truths, Float[np.ndarray, "sets records points"]]:
    """Return the parameters of new records of the same tests, shape (sets, records), and their forces (kN).

    Cases, specimens and days are those of the truths; what belongs to a record alone is drawn given these. The prior of
    F_i of a new record is that of the record it repeats, and its noise is as unlike from point to point.

    Parameters
    ----------
    records, model:
        The records as they were fitted, and the options of that fit.
    truths:
        What they share, as `posterior_truths` gives it.
    rng:
        Of the random numbers.
    planted:
        Errors to be found, in the scatter of the new repeats and in their noise.
    """
    new = _log_values(records.factors, model.priors.discordant_widening, truths, rng, planted.scatter)
    data, factors = records.data, records.factors
    shape = new["k"].shape

    def normals() -> np.ndarray:
        return rng.standard_normal(shape)

    mean_J = truths["J_group"][:, factors.group.of_case[factors.of_record]]
    new["J"] = mean_J + truths["sd_J"][:, None] * normals()
    new["F_i"] = np.asarray(data.F_0) + np.asarray(data.span) * normals()
    new["C"] = new["F_i"] + new["J"] - new["k"] * np.asarray(data.d_0)
    new["sigma"] = truths["sigma_typical"][:, None] * np.exp(truths["sd_log_sigma"][:, None] * normals())
    noise = rng.standard_normal((*shape, data.u.shape[1]))
    if "sd_atanh_rho" in truths:
        new["rho"] = np.tanh(truths["atanh_rho_typical"][:, None] + truths["sd_atanh_rho"][:, None] * normals())
        noise = _autoregressive(noise, new["rho"])
    noise = planted.noise * new["sigma"][..., None] * _unwhitened(noise, records)
    F_i, J, k, beta = (new[name][..., None] for name in ("F_i", "J", "k", "beta"))
    force = F_i + np.asarray(LAWS[model.law](data.u, k=k, J=J, beta=beta)) + noise
    return new, np.where(np.asarray(data.present), force, force[..., :1])  # as padding is elsewhere


def _log_values(
    factors: Factors, widening: float, truths: Truths, rng: np.random.Generator, planted: float
) -> dict[str, np.ndarray]:
    """Draw k and beta of each new record about its case."""
    shape = len(truths["sd_J"]), len(factors.of_record)
    wide, values = _widening(widening, truths, shape, rng), {}
    for parameter in PARAMETERS:
        sd_repeat = wide * sd_of_records(factors, parameter, truths)
        off = planted * sd_repeat * rng.standard_normal(shape)
        values[parameter] = centre_of_records(factors, parameter, truths) * np.exp(off)
    return values


def _widening(
    widening: float, truths: Truths, shape: tuple[int, int], rng: np.random.Generator
) -> Float[np.ndarray, "sets #records"]:
    """Draw how many times wider than usual each record scatters: a mixture, Student's t, or none."""
    if "discordant_weight" in truths:
        return np.where(rng.random(shape) < truths["discordant_weight"][:, None], widening, 1.0)
    if "student_nu" in truths:
        nu = np.broadcast_to(truths["student_nu"][:, None], shape)
        return np.sqrt(nu / rng.chisquare(nu))
    return np.ones((shape[0], 1))


def _autoregressive(
    z: Float[np.ndarray, "sets records points"], rho: Float[np.ndarray, "sets records"]
) -> Float[np.ndarray, "sets records points"]:
    """Return noise of variance 1 and lag-1 autocorrelation rho, from independent noise."""
    noise = z.copy()
    for point in range(1, z.shape[2]):
        noise[..., point] = rho * noise[..., point - 1] + np.sqrt(1.0 - rho**2) * z[..., point]
    return noise


def _unwhitened(
    noise: Float[np.ndarray, "sets records points"], records: PreparedRecords
) -> Float[np.ndarray, "sets records points"]:
    """Return noise as the records have it, from noise as it is where they are whitened; 0 on padding."""
    present = np.asarray(records.data.present)
    noise = np.where(present, noise, 0.0)
    if records.whitening is None:
        return noise
    made = np.empty(noise.shape)
    for record in range(len(present)):  # one matrix at a time: those of many long records would take gigabytes
        whitening, axis = records.whitening, records.whitening.axis
        own = whitening if axis is None else jax.tree.map(lambda field, i=record: field[i], whitening)
        matrix = np.asarray(_matrix(own, jnp.asarray(present[record]))) + np.diag(~present[record])
        made[:, record] = np.linalg.solve(matrix, noise[:, record].T).T
    return made


@jax.jit
def _matrix(whitening: Whitening, present: Bool[Array, " points"]) -> Float[Array, "points points"]:
    """Return the matrix by which the points of a record are whitened."""
    return jax.vmap(whitening.whiten, in_axes=(0, None), out_axes=1)(jnp.eye(len(present)), present)
