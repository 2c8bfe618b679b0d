"""The top of the hierarchy: which priors a model has, sampled a family at a time.

Each prior sampled by itself would cost NUTS some kernels a gradient, and a gradient of this hierarchy is made of little
else: all priors of a family are one site, and each is kept by its own name.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jaxtyping import Array, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.priors import CONSTANTS, Priors
from bayes_tyre.inference.model.record_levels import COVARIATE

#: Sampled values by name: hyperparameters, and what else is one for the level below.
Hyperparameters = Mapping[str, Array]

#: What a case has a value of, in the order in which arrays hold them.
PARAMETERS = ("k", "beta")
#: The same where records are motions on Fancher's law: `settled` is x - k beta, above 0 in a law that loses energy; x
#: follows from it. Other laws have other parameters (`inference.motion.laws.MotionLaw.parameters`).
MOTION_PARAMETERS = ("k", "settled", "beta", "m", "c")
#: Repeats that a case needs before one of them can be called discordant.
JUDGEABLE_REPEATS = 3
#: Repeats that a case needs, and cases beyond those that the factors fit exactly, before one of these can be said to
#: stand apart: one repeat may be discordant instead, and of few cases that differ any may be the one.
APART_REPEATS, APART_SPARE_CASES = 2, 6
#: Names that end so are sampled where their level is, in coordinates that follow what is below it.
_REPARAMETERISED = ("_group", "_typical", "_covariate")
#: Sites that every record's prior goes through, whatever its factors.
_OF_RECORDS = ("J_group", "sd_J", "sigma_typical")


def prior_sites(factors: Factors, repeats: str = "mixture", noise: str = "iid") -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of records with these levels, repeats and noise has."""
    several = len(factors.of_record) > 1
    sites = [*_OF_RECORDS, *["sd_log_sigma"] * several]
    if noise == "ar1":
        sites += ["atanh_rho_typical", *["sd_atanh_rho"] * several]
    sites += ["noise_nu"] * (noise == "student")
    return (*sites, *_case_sites(factors, PARAMETERS, repeats))


def unused_priors(priors: Priors, sites: Sequence[str]) -> list[str]:
    """Return the quantities whose priors were changed though the model with these sites does not have them."""
    return sorted(set(priors.changes_from(PRIORS)) - set(sites) - set(CONSTANTS))


def motion_sites(
    factors: Factors, repeats: str = "mixture", parameters: Sequence[str] = MOTION_PARAMETERS
) -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of motions with these levels, repeats and parameters has."""
    return _case_sites(factors, parameters, repeats)


def _case_sites(factors: Factors, parameters: Sequence[str], repeats: str) -> tuple[str, ...]:
    """Return the names of group means, effects and remainders of cases, and of standard deviations of repeats."""
    of_repeats = {"mixture": ["discordant_weight"], "student": ["student_nu"], "normal": []}[repeats]
    sites = []
    for parameter in parameters:
        sites += [f"{parameter}_group", f"sd_log_{parameter}_repeat", *effect_scales(parameter, factors)]
        sites += [f"sd_log_{parameter}_repeat_over_speeds"] * factors.speed.varies
        sites += [f"sd_log_{parameter}_case"] * factors.has_remainder(parameter)
        sites += level_sites(parameter, factors)
    return (*sites, *(of_repeats if factors.most_repeats >= JUDGEABLE_REPEATS else ()))


def level_sites(parameter: str, factors: Factors) -> list[str]:
    """Return the names of what the effects of specimens and days, and slopes on covariates, are distributed by."""
    slopes = [] if factors.levels.covariates is None else [f"log_{parameter}_{COVARIATE}"]
    return [*(f"sd_log_{parameter}_{name}" for name in factors.levels.groupings), *slopes]


def apart_weight(factors: Factors, parameters: Sequence[str], priors: Priors) -> float:
    """Return the probability that a case stands apart; 0 where the data cannot tell that one does."""
    spare = max(factors.spare_cases(parameter) for parameter in parameters)
    judgeable = spare >= APART_SPARE_CASES and factors.most_repeats >= APART_REPEATS
    return priors.apart_weight if judgeable else 0.0


def published_sites(factors: Factors) -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of printed case means with these levels has."""
    sites = []
    for parameter in PARAMETERS:
        sites += [f"{parameter}_group", f"sd_log_{parameter}_published", *effect_scales(parameter, factors)]
        sites += [f"sd_log_{parameter}_published_over_speeds"] * factors.speed.varies
    return (*sites, "student_nu")


def effect_scales(parameter: str, factors: Factors) -> list[str]:
    """Return the names of the standard deviations of the effects, in the order of `Factors.effects`."""
    return [f"sd_log_{parameter}_{name}" for name in factors.effects(parameter)]


def deterministic(name: str, value: Array) -> Array:
    """Return the value, after adding it to the posterior as a deterministic site."""
    numpyro.deterministic(name, value)
    return value


def deterministic_each(name: str, parameters: Sequence[str], values: Array) -> None:
    """Add the values of each parameter as deterministic sites, its name in place of the asterisk."""
    for parameter, value in zip(parameters, values, strict=True):
        deterministic(name.replace("*", parameter), value)


def standard_normals(name: str, shape: tuple[int, ...]) -> Array | None:
    """Return standard normals to draw by what is known in closed form; None where a density is wanted, not a draw.

    Nothing observed depends on them. They are handed in by name (`handlers.substitute`), or drawn where the model has a
    seed.
    """

    def drawn(key: Array | None) -> Array | None:
        return None if key is None else jax.random.normal(key, shape)

    return cast("Array | None", numpyro.param(name, drawn))


def of_each(name: str, parameters: Sequence[str], hyperparameters: Hyperparameters) -> Float[Array, "parameters 1"]:
    """Return a hyperparameter for each parameter, its name in place of the asterisk."""
    return jnp.stack([hyperparameters[name.replace("*", parameter)] for parameter in parameters])[:, None]


def sample_hyperparameters(sites: Iterable[str], priors: Priors = PRIORS) -> dict[str, Array]:
    """Sample the priors of these names, each a quantity of the posterior; but for those of `_REPARAMETERISED`."""
    values: dict[str, Array] = {}
    for site, names in by_family(sites, priors).items():
        sampled = jnp.asarray(numpyro.sample(site, family_of(names, priors)))
        values |= dict(zip(names, sampled, strict=True))
    for name, value in values.items():
        numpyro.deterministic(name, value)
    return values


def by_family(sites: Iterable[str], priors: Priors) -> dict[str, Sequence[str]]:
    """Return the names by the site that samples them."""
    grouped: dict[type[dist.Distribution], list[str]] = {}
    for name in sites:
        if not name.endswith(_REPARAMETERISED):
            grouped.setdefault(priors[name].family, []).append(name)
    return {f"hyperparameters_{family.__name__}": names for family, names in grouped.items()}


def family_of(names: Sequence[str], priors: Priors) -> dist.Distribution:
    """Return the priors of these names, all of one family, as one distribution."""
    # Parameters stay NumPy's: a distribution's support keeps them, and outlives the trace it is looked up in.
    return priors[names[0]].family(*np.transpose([priors[name].parameters for name in names]))
