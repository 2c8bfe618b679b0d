"""Truths drawn from the priors down the whole hierarchy, and records simulated from them: in numpy alone.

The model's own code is not used, so that it is checked and not repeated.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS, PARAMETERS, effect_scales, prior_sites
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.studies.design import START_MM, Design

#: Priors of a calibration where they are not those of `PRIORS`: about truck tyres that a record can tell of. The wide
#: ones make, in every third data set, a record from which no method could tell beta (J near zero under coarse noise,
#: beta beyond the travel), and discordant repeats of wide scatter whose k is thousands of times off.
NARROWED: dict[str, Prior] = {
    "k_group": Prior(dist.LogNormal, (np.log(1.8), 0.3), "kN/mm", "1.0 to 3.2 kN/mm: truck tyres"),
    "beta_group": Prior(dist.LogNormal, (np.log(0.1), 0.5), "mm", "0.04 to 0.27 mm: spacing below, travel above"),
    "sd_log_k_repeat": Prior(dist.LogNormal, (np.log(0.05), 0.3), "", "2.7 to 9 %"),
    "sd_log_beta_repeat": Prior(dist.LogNormal, (np.log(0.10), 0.3), "", "5.5 to 18 %"),
    "sd_log_k_repeat_over_speeds": Prior(
        dist.HalfNormal, (0.3,), "", "rolling scatters up to twice as much as standing"
    ),
    "sd_log_beta_repeat_over_speeds": Prior(dist.HalfNormal, (0.3,), "", "as for k"),
    "sd_J": Prior(dist.LogNormal, (np.log(3.0), 0.3), "kN", "1.7 to 5.4 kN: an offset that noise does not hide"),
    "sigma_typical": Prior(dist.LogNormal, (np.log(0.006), 0.4), "kN", "0.003 to 0.013 kN: a good load cell"),
    "sd_log_sigma": Prior(dist.HalfNormal, (0.4,), "", "noise differs by a factor of two among records"),
}

#: Truths by name of the site, shape (sets, ...).
Truths = dict[str, np.ndarray]


class Planted(NamedTuple):
    """Factors by which truths are made to differ from what the model holds; 1: not at all.

    Attributes
    ----------
    scatter:
        On the scatter of repeats about their case.
    scales:
        On the half-normal scales of the effects of words.
    noise:
        On the noise of every point.
    """

    scatter: float = 1.0
    scales: float = 1.0
    noise: float = 1.0


NOTHING = Planted()


def draw_truths(design: Design, sets: int, rng: np.random.Generator, priors: Priors, planted: Planted) -> Truths:
    """Return `sets` independent draws of everything the model of a design's records holds, by name of the site.

    `discordant` says which repeats are. Parameters of `planted` other than 1 make them truths of another model.
    """
    factors = design.factors
    record, records = factors.of_record, len(factors.of_record)
    scalar = [site for site in prior_sites(factors) if not site.endswith("_group")]
    truths: Truths = {site: _draw(priors[site], (sets,), rng) for site in scalar}
    for name in (name for parameter in PARAMETERS for name in effect_scales(parameter, factors)):
        truths[name] = planted.scales * truths[name]
    weight = truths["discordant_weight"][:, None] if factors.repeats.max() >= JUDGEABLE_REPEATS else 0.0
    truths["discordant"] = rng.random((sets, records)) < weight
    for parameter in PARAMETERS:
        mean = _case_means(parameter, design, truths, rng, priors)
        truths[f"{parameter}_case"] = np.exp(mean)
        wide = np.where(truths["discordant"], priors.discordant_widening, 1.0) * planted.scatter
        scatter = wide * _scatter(parameter, design, truths, rng)[:, record]
        truths[parameter] = np.exp(mean[:, record] + scatter * rng.standard_normal((sets, records)))
    truths["J"] = truths["sd_J"][:, None] * rng.standard_normal((sets, records))
    truths["F_i"] = design.start_kN + design.span_kN * rng.standard_normal((sets, records))
    truths["C"] = truths["F_i"] + truths["J"] - truths["k"] * START_MM
    spread = truths["sd_log_sigma"][:, None] * rng.standard_normal((sets, records))
    truths["sigma"] = truths["sigma_typical"][:, None] * np.exp(spread)
    return truths


def simulate_forces(
    design: Design, truths: Truths, rng: np.random.Generator, planted: Planted = NOTHING
) -> Float[np.ndarray, "sets records points"]:
    """Return forces (kN) by Equation 2, with normal noise on every point."""
    F_i, J, k, beta, sigma = (truths[name][:, :, None] for name in ("F_i", "J", "k", "beta", "sigma"))
    rise = -np.expm1(-np.abs(design.u) / beta)
    force = F_i + (J + k * design.u) * rise
    return force + planted.noise * sigma * rng.standard_normal(force.shape)


def study_priors() -> Priors:
    """Return every prior of a calibration: those of the model, some of them narrowed."""
    return PRIORS.changed(NARROWED)


def _draw(prior: Prior, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    if prior.family is dist.LogNormal:
        return rng.lognormal(*prior.parameters, size=shape)
    if prior.family is dist.HalfNormal:
        return np.abs(rng.normal(0.0, *prior.parameters, size=shape))
    if prior.family is dist.Beta:
        return rng.beta(*prior.parameters, size=shape)
    raise NotImplementedError(f"a truth of family {prior.family.__name__}")


def _case_means(
    parameter: str, design: Design, truths: Truths, rng: np.random.Generator, priors: Priors
) -> Float[np.ndarray, "sets cases"]:
    """Return log k or log beta of each case, and put its cells and effects among the truths."""
    factors, sets = design.factors, len(truths["sd_J"])
    cell = _draw(priors[f"{parameter}_group"], (sets, len(factors.group.labels)), rng)
    truths[f"{parameter}_group"] = cell
    mean = np.log(cell)[:, factors.group.of_case]
    for name, factor in factors.effects(parameter).items():
        free = rng.standard_normal((sets, factor.basis.shape[1]))
        effect = truths[f"sd_log_{parameter}_{name}"][:, None] * free @ factor.basis.T
        truths[f"log_{parameter}_{name}"] = effect
        mean = mean + effect[:, factor.of_case] * factor.weight
    remainder = truths.get(f"sd_log_{parameter}_case", np.zeros(sets))
    return mean + remainder[:, None] * rng.standard_normal(mean.shape)


def _scatter(
    parameter: str, design: Design, truths: Truths, rng: np.random.Generator
) -> Float[np.ndarray, "sets cases"]:
    """Return the scatter of each case's repeats, and put it by speed among the truths."""
    factors = design.factors
    typical = truths[f"sd_log_{parameter}_repeat"][:, None]
    if not factors.speed.varies:
        return np.repeat(typical, len(factors.cases), axis=1)
    spread = truths[f"sd_log_{parameter}_repeat_over_speeds"][:, None]
    by_speed = typical * np.exp(spread * rng.standard_normal((len(typical), len(factors.speed.labels))))
    truths[f"sd_log_{parameter}_repeat_by_speed"] = by_speed
    return by_speed[:, factors.speed.of_case]
