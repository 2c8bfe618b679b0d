"""What the priors alone say: of single scales, and of whole records drawn down the hierarchy with no data."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from scipy import stats

from bayes_tyre.inference.hierarchical import JUDGEABLE_REPEATS
from bayes_tyre.inference.levels import Levels
from bayes_tyre.inference.priors import DISCORDANT_WIDENING, PRIORS
from bayes_tyre.laws.fancher import equation_2_offset

PARAMETERS = ("k", "beta")
#: Sites that every record's prior goes through, whatever its words.
_OF_RECORDS = ("J_scale", "sigma_typical")

_IN_SCIPY: dict[type[dist.Distribution], Callable[..., Any]] = {
    dist.LogNormal: lambda location, scale: stats.lognorm(scale, scale=np.exp(location)),
    dist.HalfNormal: lambda scale: stats.halfnorm(scale=scale),
    dist.Beta: stats.beta,
    dist.Normal: stats.norm,
}


class Start(NamedTuple):
    """Where a record starts and how far it goes, which its prior takes from the record itself.

    Attributes
    ----------
    F_0, span:
        First force, and the largest change of force, kN: F_i is normal about the one with the other as its sd.
    displacement_mm:
        Shape (points,), mm.
    """

    F_0: float
    span: float
    displacement_mm: Float[np.ndarray, " points"]


def prior_sites(levels: Levels, repeats: str = "mixture", noise: str = "iid") -> tuple[str, ...]:
    """Return the sites of `PRIORS` that the model of records with these levels, repeats and noise samples."""
    several = len(levels.of_record) > 1
    of_repeats = {"mixture": ["discordant_weight"], "student": ["student_nu"], "normal": []}[repeats]
    sites = [*_OF_RECORDS, *["log_sigma_spread"] * several]
    if noise == "ar1":
        sites += ["atanh_rho_typical", *["atanh_rho_spread"] * several]
    for parameter in PARAMETERS:
        sites += [f"{parameter}_cell", f"log_{parameter}_repeat_scatter"]
        sites += [f"log_{parameter}_{name}_scale" for name in levels.factors(parameter)]
        sites += [f"log_{parameter}_scatter_spread"] * levels.speed.varies
        sites += [f"log_{parameter}_case_scale"] * levels.has_remainder(parameter)
    return (*sites, *(of_repeats if levels.repeats.max() >= JUDGEABLE_REPEATS else ()))


def prior_law(site: str) -> Any:
    """Return a prior of `PRIORS` as a frozen law of SciPy: with quantiles, and with nothing for JAX to compile."""
    prior = PRIORS[site]
    return _IN_SCIPY[prior.family](*prior.parameters)


def is_of_logarithm(site: str) -> bool:
    """Return whether a prior is spread on the logarithm of its quantity: zero is then out of its reach."""
    return issubclass(PRIORS[site].family, dist.LogNormal)


def prior_draws(sites: tuple[str, ...], draws: int, seed: int) -> dict[str, Float[np.ndarray, " draws"]]:
    """Return independent draws of single sites of `PRIORS`, each in its unit."""
    rng = np.random.default_rng(seed)
    return {site: prior_law(site).rvs(draws, random_state=rng) for site in sites}


def prior_parameters(
    levels: Levels, case: int, draws: int, seed: int, repeats: str = "mixture"
) -> dict[str, Float[np.ndarray, " draws"]]:
    """Return k (kN/mm), beta (mm), J and sigma (kN) of one record of a case, every draw from populations of its own.

    As `bayes_tyre.inference.hierarchical.records_model` has them: the cell, an effect of each word that varies, the
    case's remainder, the scatter of repeats (wider where the record is discordant, or in a Student-t's tails), J and
    sigma of a record. A common factor on displacement is left out: it is far narrower than the priors.
    """
    sites = prior_draws(prior_sites(levels, repeats), draws, seed)
    rng = np.random.default_rng((seed, 0))
    widening = np.where(rng.random(draws) < sites.get("discordant_weight", 0.0), DISCORDANT_WIDENING, 1.0)
    if "student_nu" in sites:
        widening = np.sqrt(sites["student_nu"] / rng.chisquare(sites["student_nu"]))
    found = {}
    for parameter in PARAMETERS:
        log_value = np.log(sites[f"{parameter}_cell"])
        for name, factor in levels.factors(parameter).items():
            effects = rng.standard_normal((draws, factor.basis.shape[1])) @ factor.design[case]
            log_value = log_value + sites[f"log_{parameter}_{name}_scale"] * effects
        remainder = sites.get(f"log_{parameter}_case_scale", 0.0) * rng.standard_normal(draws)
        spread = sites.get(f"log_{parameter}_scatter_spread", 0.0) * rng.standard_normal(draws)
        scatter = widening * sites[f"log_{parameter}_repeat_scatter"] * np.exp(spread)
        found[parameter] = np.exp(log_value + remainder + scatter * rng.standard_normal(draws))
    found["J"] = sites["J_scale"] * rng.standard_normal(draws)
    spread = sites.get("log_sigma_spread", 0.0)
    found["sigma"] = sites["sigma_typical"] * np.exp(spread * rng.standard_normal(draws))
    return found


def prior_records(
    levels: Levels, case: int, start: Start, draws: int = 1000, seed: int = 0, repeats: str = "mixture"
) -> Float[np.ndarray, "draws points"]:
    """Return the forces (kN) of records of a case drawn from the priors alone, noise of each point included.

    Parameters
    ----------
    levels, case:
        How the cases group, and which of them the records repeat.
    start:
        Where each record starts and how far it goes.
    draws:
        How many records.
    seed:
        The same seed gives the same records.
    repeats:
        How repeats scatter about their case.
    """
    parameters = prior_parameters(levels, case, draws, seed, repeats)
    of_record = {name: values[:, None] for name, values in parameters.items()}
    rng = np.random.default_rng((seed, 1))
    F_i = start.F_0 + start.span * rng.standard_normal((draws, 1))
    u = start.displacement_mm - start.displacement_mm[0]
    change = equation_2_offset(u, k=of_record["k"], J=of_record["J"], beta=of_record["beta"])
    return F_i + np.asarray(change) + of_record["sigma"] * rng.standard_normal((draws, len(u)))
