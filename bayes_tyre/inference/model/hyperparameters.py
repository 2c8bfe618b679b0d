"""The top of the hierarchy: which priors a model has, sampled a family at a time.

Each prior sampled by itself would cost NUTS some kernels a gradient, and a gradient of this hierarchy is made of little
else: all priors of a family are one site, and each is kept by its own name.
"""

from collections.abc import Iterable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np
import numpyro
from jaxtyping import Array
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.half_normal import HalfNormal
from bayes_tyre.inference.model.priors import Priors

#: What a case has a value of, in the order in which arrays hold them.
PARAMETERS = ("k", "beta")
#: The same where records are motions on Fancher's law: `settled` is x - k beta, above 0 in a law that loses energy; x
#: follows from it. Other laws have other parameters (`motion_laws.MotionLaw.parameters`).
MOTION_PARAMETERS = ("k", "settled", "beta", "m", "c")
#: Repeats that a case needs before one of them can be called discordant.
JUDGEABLE_REPEATS = 3
#: Names that end so are sampled where their level is, in coordinates that follow what is below it.
_PLACED = ("_group", "_typical")
#: Laws that NUTS walks in coordinates other than NumPyro's.
_SAMPLED_AS: Mapping[type[dist.Distribution], type[dist.Distribution]] = {dist.HalfNormal: HalfNormal}
#: Sites that every record's prior goes through, whatever its factors.
_OF_RECORDS = ("sd_J", "sigma_typical")


def prior_sites(factors: Factors, repeats: str = "mixture", noise: str = "iid") -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of records with these levels, repeats and noise has."""
    several = len(factors.of_record) > 1
    sites = [*_OF_RECORDS, *["sd_log_sigma"] * several]
    if noise == "ar1":
        sites += ["atanh_rho_typical", *["sd_atanh_rho"] * several]
    return (*sites, *_case_sites(factors, PARAMETERS, repeats))


def motion_sites(
    factors: Factors, repeats: str = "mixture", parameters: Sequence[str] = MOTION_PARAMETERS
) -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of motions with these levels, repeats and parameters has."""
    return _case_sites(factors, parameters, repeats)


def _case_sites(factors: Factors, parameters: Sequence[str], repeats: str) -> tuple[str, ...]:
    """Return the names of cells, effects and remainders of cases, and of the scatter of repeats about them."""
    of_repeats = {"mixture": ["discordant_weight"], "student": ["student_nu"], "normal": []}[repeats]
    sites = []
    for parameter in parameters:
        sites += [f"{parameter}_group", f"sd_log_{parameter}_repeat", *effect_scales(parameter, factors)]
        sites += [f"sd_log_{parameter}_repeat_over_speeds"] * factors.speed.varies
        sites += [f"sd_log_{parameter}_case"] * factors.has_remainder(parameter)
    return (*sites, *(of_repeats if factors.repeats.max() >= JUDGEABLE_REPEATS else ()))


def published_sites(factors: Factors) -> tuple[str, ...]:
    """Return the names in `PRIORS` that the model of printed case means with these levels has."""
    sites = []
    for parameter in PARAMETERS:
        sites += [f"{parameter}_group", f"sd_log_{parameter}_published", *effect_scales(parameter, factors)]
    return tuple(sites)


def effect_scales(parameter: str, factors: Factors) -> list[str]:
    """Return the names of the standard deviations of the effects, in the order of `Factors.effects`."""
    return [f"sd_log_{parameter}_{name}" for name in factors.effects(parameter)]


def sample_hyperparameters(sites: Iterable[str], priors: Priors = PRIORS) -> dict[str, Array]:
    """Sample the priors of these names, and keep each among the posterior's quantities; those of `_PLACED` are not."""
    found: dict[str, Array] = {}
    for site, names in _by_family(sites, priors).items():
        family, parameters = priors[names[0]].family, np.transpose([priors[name].parameters for name in names])
        sampled = _SAMPLED_AS.get(family, family)
        # Parameters stay NumPy's: a law's support keeps them, and outlives the trace it is looked up in.
        values = jnp.asarray(numpyro.sample(site, sampled(*parameters)))
        found |= dict(zip(names, values, strict=True))
    for name, value in found.items():
        numpyro.deterministic(name, value)
    return found


def hyperparameter_starts(
    sites: Iterable[str], values: Mapping[str, np.ndarray], priors: Priors = PRIORS
) -> dict[str, np.ndarray]:
    """Return values by name of the prior as the starts of the sites of `sample_hyperparameters`."""
    return {site: np.stack([values[name] for name in names]) for site, names in _by_family(sites, priors).items()}


def _by_family(sites: Iterable[str], priors: Priors) -> dict[str, Sequence[str]]:
    """Return the names by the site that samples them."""
    grouped: dict[type[dist.Distribution], list[str]] = {}
    for name in sites:
        if not name.endswith(_PLACED):
            grouped.setdefault(priors[name].family, []).append(name)
    return {f"populations_{family.__name__}": names for family, names in grouped.items()}
