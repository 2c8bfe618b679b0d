"""Log prior and log likelihood of every draw, which sampling does not store: for power-scaling.

The prior here is that of the top level alone: group means, standard deviations and all others in `PRIORS`. The
distributions of lower levels, such as of cases about their group or of records about their case, are part of the model,
neither prior nor likelihood: Kallioinen et al. (2024), "Detecting and diagnosing prior and likelihood sensitivity with
power-scaling", Statistics and Computing 34, section 2.3, scale hierarchical models so.
"""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float
from scipy import stats

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood, Likelihood
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.record_data import RecordData
from bayes_tyre.inference.sampling.common_scales import as_measured

#: Numbers that the densities of the draws taken together may hold at once: memory stays, however many draws.
_TOGETHER = 2_000_000
#: Of a table entry of the compressed likelihood, per record: coefficients times products.
_GATHERED = 100
SAMPLE = ("chain", "draw")


def log_prior(
    posterior: xr.Dataset, sites: Sequence[str], data: RecordData | None = None, priors: Priors = PRIORS
) -> xr.Dataset:
    """Return the log density of each top-level prior at each draw, a variable a site; dims chain, draw (and group).

    A prior spread on a logarithm has its density per unit of that: raised to a power it keeps its median and changes
    its width. A factor on displacement is not part of it, because it is fixed.

    Parameters
    ----------
    posterior:
        As `bayes_tyre.inference.sampling.datatree.to_datatree` or `common_scales.with_scale` gives it.
    sites:
        The model's sites in `PRIORS`; those that the posterior lacks are passed over.
    data:
        The records, for the prior of their F_i; None: there are none.
    priors:
        That the posterior was fitted with.
    """
    measured = as_measured(posterior)
    densities = {}
    for site in sites:
        if site not in measured:
            continue
        values = measured[site].to_numpy()
        with np.errstate(divide="ignore", invalid="ignore"):  # the verdict reports draws that are not finite
            density = priors[site].scipy().logpdf(values) + (np.log(values) if priors[site].of_logarithm else 0.0)
        densities[site] = measured[site].copy(data=density)
    if data is not None:
        F_i = measured["F_i"].transpose(*SAMPLE, "record").to_numpy()
        density = stats.norm.logpdf(F_i, np.asarray(data.F_0), np.asarray(data.span)).sum(axis=2)
        densities["F_i"] = xr.DataArray(density, dims=SAMPLE)
    return without_labels(densities)


def log_likelihood_of_records(posterior: xr.Dataset, likelihood: Likelihood | StudentLikelihood) -> xr.Dataset:
    """Return the log density of each record's forces at each draw: `force`, dims chain, draw, record.

    ArviZ's `loo` on it leaves a record out and keeps the record's own parameters, which is not a prediction:
    `bayes_tyre.inference.diagnostics.leave_one_out.fits` integrates them out.
    """
    measured = as_measured(posterior)

    def flat(name: str) -> np.ndarray:
        values = measured[name].transpose(*SAMPLE, "record").to_numpy()
        return values.reshape(-1, values.shape[2])

    theta = np.stack([flat("F_i"), flat("J"), np.log(flat("k")), np.log(flat("beta"))], axis=2)
    shape_of_noise = jnp.asarray(flat("rho")) if "rho" in measured else None
    if isinstance(likelihood, StudentLikelihood):
        shape_of_noise = jnp.asarray(measured["noise_nu"].transpose(*SAMPLE).to_numpy().ravel())
    by_point = isinstance(likelihood, (DirectLikelihood, StudentLikelihood))
    work = likelihood.data.u.size if by_point else theta.shape[1] * _GATHERED
    together = max(1, min(len(theta), _TOGETHER // work))
    density = _at_each(likelihood, jnp.asarray(theta), jnp.asarray(flat("sigma")), shape_of_noise, together)
    shape = [measured.sizes[dim] for dim in (*SAMPLE, "record")]
    force = measured["sigma"].transpose(*SAMPLE, "record").copy(data=np.asarray(density).reshape(shape))
    return without_labels({"force": force})


@eqx.filter_jit
def _at_each(
    likelihood: Likelihood | StudentLikelihood,
    theta: Float[Array, "draws records 4"],
    sigma: Float[Array, "draws records"],
    shape_of_noise: Float[Array, "draws *records"] | None,
    together: int,
) -> Float[Array, "draws records"]:
    return jax.lax.map(lambda one: likelihood(*one), (theta, sigma, shape_of_noise), batch_size=together)


def log_likelihood_of_print(posterior: xr.Dataset, printed: Mapping[str, np.ndarray]) -> xr.Dataset:
    """Return the log density of each printed case mean at each draw: `printed_k`, `printed_beta`, dims ..., case.

    Parameters
    ----------
    posterior:
        Of `bayes_tyre.inference.model.models.published_model`.
    printed:
        ``k`` (kN/mm) and ``beta`` (mm) by case.
    """
    densities = {}
    for parameter, values in printed.items():
        typical = posterior[f"{parameter}_case"].transpose(*SAMPLE, "case")
        sd_published, nu = posterior[f"sd_log_{parameter}_published"].to_numpy(), posterior["student_nu"].to_numpy()
        if f"sd_log_{parameter}_published_by_speed" in posterior:
            of_case = np.unique(posterior["case_speed_km_h"].to_numpy(), return_inverse=True)[1]
            by_speed = posterior[f"sd_log_{parameter}_published_by_speed"].transpose(*SAMPLE, "speed").to_numpy()
            sd_published = by_speed[..., of_case]
        sd_published = sd_published.reshape(*nu.shape, -1)
        off = np.log(values) - np.log(typical.to_numpy())
        density = stats.t.logpdf(off, nu[..., None], 0.0, sd_published) - np.log(values)
        densities[f"printed_{parameter}"] = typical.copy(data=density)
    return without_labels(densities)


def without_labels(densities: Mapping[str, xr.DataArray]) -> xr.Dataset:
    """Return the densities without units, and without the factors along their cases and records."""
    named = xr.Dataset(dict(densities))
    bare = named.drop_vars([name for name in named.coords if name not in named.dims])
    for name in bare.data_vars:
        bare[name].attrs = {}
    return bare
