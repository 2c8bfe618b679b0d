"""Truths drawn down the hierarchy in numpy alone, as the documentation has it: what the model is held to."""

import numpy as np
from helpers.density_by_hand import can_stand_apart
from jaxtyping import Float
from numpyro import distributions as dist

from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS, PARAMETERS, prior_sites
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.studies.design import START_MM, Design
from bayes_tyre.studies.truths import Truths


def draw_by_hand(design: Design, sets: int, rng: np.random.Generator, priors: Priors) -> Truths:
    """Return `sets` independent draws of everything that the model of a design's records holds, by name."""
    factors = design.factors
    record, records = factors.of_record, len(factors.of_record)
    scalar = [site for site in prior_sites(factors) if not site.endswith("_group")]
    truths: Truths = {site: _draw(priors[site], (sets,), rng) for site in scalar}
    weight = truths["discordant_weight"][:, None] if factors.repeats.max() >= JUDGEABLE_REPEATS else 0.0
    discordant = rng.random((sets, records)) < weight
    for parameter in PARAMETERS:
        mean = _case_means(parameter, design, truths, rng, priors)
        truths[f"{parameter}_case"] = np.exp(mean)
        wide = np.where(discordant, priors.discordant_widening, 1.0)
        scatter = wide * _scatter(parameter, design, truths, rng)[:, record]
        truths[parameter] = np.exp(mean[:, record] + scatter * rng.standard_normal((sets, records)))
    truths["J_group"] = rng.normal(*priors["J_group"].parameters, size=(sets, len(factors.group.labels)))
    truths["J"] = truths["J_group"][:, factors.group.of_case[record]]
    truths["J"] = truths["J"] + truths["sd_J"][:, None] * rng.standard_normal((sets, records))
    truths["F_i"] = design.start_kN + design.span_kN * rng.standard_normal((sets, records))
    truths["C"] = truths["F_i"] + truths["J"] - truths["k"] * START_MM
    spread = truths["sd_log_sigma"][:, None] * rng.standard_normal((sets, records))
    truths["sigma"] = truths["sigma_typical"][:, None] * np.exp(spread)
    return truths


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
    apart = (rng.random(mean.shape) < priors.apart_weight) & can_stand_apart(factors)
    wide = np.where(apart, priors.apart_widening, 1.0)
    return mean + wide * remainder[:, None] * rng.standard_normal(mean.shape)


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
