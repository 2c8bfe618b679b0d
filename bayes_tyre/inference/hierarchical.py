"""The NumPyro models: records, repeats in a case, cases by configuration, direction, speed, load and step.

Two models share the level of the cases: `records_model` takes force against displacement, `published_model` takes
case means such as Tables 9 and 11 alone.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.special import gammaln
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.coordinates import Gaussian, place, place_jointly, place_pair
from bayes_tyre.inference.levels import Levels
from bayes_tyre.inference.likelihood import Likelihood
from bayes_tyre.inference.picture import CaseEstimates, Picture, RecordData, RecordEstimates
from bayes_tyre.inference.priors import DISCORDANT_WIDENING, PRIORS

#: Repeats that a case needs before one of them can be called discordant.
JUDGEABLE_REPEATS = 3
#: Repeats that a case without any counts as in its coordinates: an estimate without weight.
_ALMOST_NONE = 1e-6
#: How the records of a case scatter about it, and what the noise of a record is like.
REPEATS, NOISE = ("mixture", "student", "normal"), ("iid", "ar1")


def _sample(site: str, distribution: dist.Distribution) -> Array:
    return jnp.asarray(numpyro.sample(site, distribution))


def _prior(name: str) -> Array:
    return _sample(name, PRIORS[name].distribution())


def _keep(name: str, value: Array) -> Array:
    """Return the value, and keep it among the posterior's quantities."""
    numpyro.deterministic(name, value)
    return value


def _flat(site: str, shape: tuple[int, ...]) -> Array:
    """Sample coordinates with a flat density: priors and likelihood enter on the placed values, as factors."""
    return _sample(site, dist.ImproperUniform(dist.constraints.real, (), shape))


def _placed(site: str, estimate: Gaussian, above: ArrayLike, scale: ArrayLike) -> Array:
    """Sample unknowns that are Normal(above, scale), in coordinates that follow the scale and the estimate."""
    above, scale = jnp.asarray(above), jnp.asarray(scale)
    placed = place(_flat(f"{site}_z", estimate.value.shape), estimate, above, scale)
    numpyro.factor(f"{site}_density", dist.Normal(0.0, scale).log_prob(placed.deviation) + placed.log_volume)
    return placed.value


def case_structure(parameter: str, levels: Levels, estimate: Gaussian) -> Float[Array, " cases"]:
    """Return the mean of the logarithm of `k` (kN/mm) or `beta` (mm) that the words of each case predict.

    Configuration x direction, plus partially pooled speed, initial load and size of the step (for beta
    direction x step too). A word with one level has no term. Effects lie in their factor's basis: what levels share
    would otherwise be said twice, here and in the cells, and the sampler would crawl along the ridge between the two.

    `estimate` shapes the coordinates: what is known of each case, with its precision about what the words say.
    """
    location, width = PRIORS[f"{parameter}_cell"].parameters
    factors, cells = levels.factors(parameter), len(levels.cell.labels)
    scales = [jnp.full(cells, width)]
    scales += [jnp.repeat(_prior(f"log_{parameter}_{name}_scale"), f.basis.shape[1]) for name, f in factors.items()]
    scale, design = jnp.concatenate(scales), jnp.asarray(levels.design(parameter))
    above = jnp.zeros(len(scale)).at[:cells].set(location)
    placed = place_jointly(_flat(f"{parameter}_words_z", scale.shape), design, estimate, above, scale)
    numpyro.factor(f"{parameter}_words_density", dist.Normal(0.0, scale).log_prob(placed.deviation).sum())
    numpyro.factor(f"{parameter}_words_volume", placed.log_volume)
    numpyro.deterministic(f"{parameter}_cell", jnp.exp(placed.value[:cells]))
    start = cells
    for name, factor in factors.items():
        here = placed.value[start : start + factor.basis.shape[1]]
        numpyro.deterministic(f"log_{parameter}_{name}", jnp.asarray(factor.basis) @ here)
        start += factor.basis.shape[1]
    return design @ placed.value


def _repeat_scatter(parameter: str, levels: Levels, estimate: Gaussian) -> Float[Array, " cases"]:
    """Return the scatter of log k or log beta among repeats at each case's speed, partially pooled over speeds."""
    name = f"log_{parameter}_repeat_scatter"
    typical = _prior(name)
    if not levels.speed.varies:
        return jnp.broadcast_to(typical, (len(levels.cases),))
    log_scatter = _placed(name, estimate, jnp.log(typical), _prior(f"log_{parameter}_scatter_spread"))
    return _keep(f"{name}_by_speed", jnp.exp(log_scatter))[levels.speed.of_case]


def _case_level(
    parameter: str, levels: Levels, estimates: CaseEstimates, scatter: Float[Array, " cases"]
) -> Float[Array, " cases"]:
    """Return log k or log beta of each case: what its words predict, and a remainder.

    Where a remainder cannot be told from the scatter of repeats or from the words, there is none.
    """
    repeats = np.maximum(levels.repeats, _ALMOST_NONE)
    variance = (scatter**2 + estimates.variance) / jnp.asarray(repeats)
    remainder = _prior(f"log_{parameter}_case_scale") if levels.has_remainder(parameter) else None
    about_words = variance if remainder is None else variance + remainder**2
    mean = case_structure(parameter, levels, Gaussian(estimates.median, 1.0 / about_words))
    if remainder is not None:
        mean = _placed(f"{parameter}_case", Gaussian(estimates.median, 1.0 / variance), mean, remainder)
    numpyro.deterministic(f"{parameter}_case", jnp.exp(mean))
    return mean


def _repeats(deviation: Float[Array, "records 2"], scatter: Float[Array, "records 2"], kind: str) -> None:
    """Add the density of the records' (log k, log beta) about their cases.

    Of a mixture the discordant records scatter more widely: the indicator of each is summed out, and its posterior
    probability is `discordant_probability`. Of a Student-t both scatter more widely together, as one draw does.
    """

    def about_case(widening: float) -> Float[Array, " records"]:
        return dist.Normal(0.0, widening * scatter).log_prob(deviation).sum(axis=1)

    if kind == "normal":
        numpyro.factor("repeats", about_case(1.0))
        return
    if kind == "student":
        nu = _prior("student_nu")
        # A bivariate t on independent axes: a normal whose variance is nu over a chi-squared number of nu degrees.
        squares = jnp.sum((deviation / scatter) ** 2, axis=1)
        volume = gammaln(0.5 * nu + 1.0) - gammaln(0.5 * nu) - jnp.log(nu * jnp.pi) - jnp.sum(jnp.log(scatter), axis=1)
        numpyro.factor("repeats", volume - (0.5 * nu + 1.0) * jnp.log1p(squares / nu))
        return
    weight = _prior("discordant_weight")
    usual = jnp.log1p(-weight) + about_case(1.0)
    discordant = jnp.log(weight) + about_case(DISCORDANT_WIDENING)
    numpyro.factor("repeats", jnp.logaddexp(usual, discordant))
    numpyro.deterministic("discordant_probability", jax.nn.sigmoid(discordant - usual))


def _record_level(picture: Picture, levels: Levels, repeats: str) -> Float[Array, "records 4"]:
    """Return each record's (F_i, J, log k, log beta), with the density of the last two about their case."""
    estimates, scatter, case = picture.records, [], []
    for parameter, of_cases in (("k", picture.k), ("beta", picture.beta)):
        by_case = _repeat_scatter(parameter, levels, of_cases.log_scatter)
        scatter.append(by_case[levels.of_record])
        case.append(_case_level(parameter, levels, of_cases, by_case)[levels.of_record])
    above, scale = jnp.stack(case, axis=1), jnp.stack(scatter, axis=1)
    centre = estimates.centre
    pair = place_pair(_flat("shape_z", above.shape), centre[:, 2:], estimates.precision, above, scale)
    numpyro.factor("shape_volume", pair.log_volume)
    # Two repeats that differ cannot say which of them is odd, nor how heavy the tails are.
    _repeats(pair.deviation, scale, repeats if levels.repeats.max() >= JUDGEABLE_REPEATS else "normal")
    deviation = jnp.einsum("rij,rj->ri", estimates.slope, pair.value - centre[:, 2:])
    level = centre[:, :2] + deviation + jnp.einsum("rij,rj->ri", estimates.factor, _flat("level_z", above.shape))
    return jnp.concatenate([level, pair.value], axis=1)


def _autocorrelation(estimates: RecordEstimates) -> Float[Array, " records"]:
    """Return rho of each record's noise, partially pooled; one record alone is the typical one."""
    typical = _prior("atanh_rho_typical")
    if len(estimates.rho) == 1:
        return _keep("rho", jnp.tanh(jnp.reshape(typical, (1,))))
    told = Gaussian(jnp.arctanh(estimates.rho), estimates.points * (1.0 - estimates.rho**2))
    return _keep("rho", jnp.tanh(_placed("rho", told, typical, _prior("atanh_rho_spread"))))


def _noise(estimates: RecordEstimates, rho: Float[Array, " records"] | None) -> Float[Array, " records"]:
    """Return sigma (kN) of each record, partially pooled; one record alone is the typical one."""
    if len(estimates.log_sigma) == 1:
        return _keep("sigma", jnp.reshape(_prior("sigma_typical"), (1,)))
    value = estimates.log_sigma
    if rho is not None:
        # What is new in each point is known whatever rho is; sigma then follows rho.
        value = value + 0.5 * (jnp.log1p(-(estimates.rho**2)) - jnp.log1p(-(rho**2)))
    told = Gaussian(value, 2.0 * estimates.points)
    log_sigma = _placed("sigma", told, jnp.log(_prior("sigma_typical")), _prior("log_sigma_spread"))
    return _keep("sigma", jnp.exp(log_sigma))


def records_model(
    likelihood: Likelihood,
    data: RecordData,
    picture: Picture,
    levels: Levels,
    *,
    repeats: str = "mixture",
    noise: str = "iid",
) -> None:
    """Model the forces of all records (NumPyro model; sites in kN, mm; scales of k and beta are relative).

    Parameters
    ----------
    likelihood:
        Of the records' forces.
    data:
        The records as measured: where each starts.
    picture:
        Their Gaussian picture, which shapes the coordinates and leaves the posterior as it is.
    levels:
        Cases and how they group.
    repeats:
        One of `REPEATS`; with fewer than `JUDGEABLE_REPEATS` repeats a case, always ``normal``.
    noise:
        One of `NOISE`; ``ar1`` samples a lag-1 autocorrelation rho for each record.
    """
    theta = _record_level(picture, levels, repeats)
    F_i, J, log_k, log_beta = theta.T
    numpyro.factor("F_i_prior", dist.Normal(data.F_0, data.span).log_prob(F_i))
    numpyro.factor("J_prior", dist.Normal(0.0, _prior("J_scale")).log_prob(J))
    rho = _autocorrelation(picture.records) if noise == "ar1" else None
    numpyro.factor("force", likelihood(theta, _noise(picture.records, rho), rho))

    k = _keep("k", jnp.exp(log_k))
    numpyro.deterministic("beta", jnp.exp(log_beta))
    numpyro.deterministic("J", J)
    numpyro.deterministic("F_i", F_i)
    numpyro.deterministic("C", F_i + J - k * data.d_0)


def published_model(values: Mapping[str, Float[np.ndarray, " cases"]], levels: Levels) -> None:
    """Model printed case means, one a case, such as Tables 9 and 11.

    One value a case cannot tell the scatter of repeats from the case's remainder: both are one term, and
    `k_case`, `beta_case` are the value to expect in print for a case with these words. The ratio of two
    configurations is therefore the same in every case of a direction.

    Parameters
    ----------
    values:
        ``k`` (kN/mm) and ``beta`` (mm) by case.
    levels:
        How the cases group.
    """
    for parameter, printed in values.items():
        scatter = _prior(f"published_scatter_{parameter}")
        known = Gaussian(jnp.log(jnp.asarray(printed)), jnp.full(len(printed), scatter**-2.0))
        mean = case_structure(parameter, levels, known)
        # The mean of a log-normal number, not its median: printed averages over cases are to be met by averages.
        numpyro.deterministic(f"{parameter}_case", jnp.exp(mean + 0.5 * scatter**2))
        numpyro.sample(f"published_{parameter}", dist.LogNormal(mean, scatter), obs=printed)
