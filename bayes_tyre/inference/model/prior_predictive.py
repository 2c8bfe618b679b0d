"""What the priors alone say: of single scales, and of whole records drawn down the hierarchy with no data."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, prior_sites
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.laws.fancher import equation_2_offset


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


class RecordStarts(NamedTuple):
    """Where the records start: first force (kN), largest change of force (kN) and first displacement (mm) of each."""

    F_0: Float[np.ndarray, " records"]
    span: Float[np.ndarray, " records"]
    d_0: Float[np.ndarray, " records"]


def prior_draws(
    sites: tuple[str, ...], draws: int, seed: int, priors: Priors = PRIORS
) -> dict[str, Float[np.ndarray, " draws"]]:
    """Return independent draws of single sites of `PRIORS`, each in its unit."""
    rng = np.random.default_rng(seed)
    return {site: priors[site].scipy().rvs(draws, random_state=rng) for site in sites}


def prior_parameters(
    factors: Factors, case: int, draws: int, seed: int, repeats: str = "mixture", priors: Priors = PRIORS
) -> dict[str, Float[np.ndarray, " draws"]]:
    """Return k (kN/mm), beta (mm), J and sigma (kN) of one record of a case, every draw from populations of its own.

    As `bayes_tyre.inference.model.models.records_model` has them: the cell, an effect of each word that varies, the
    case's remainder, the scatter of repeats (wider where the record is discordant, or in a Student-t's tails), J and
    sigma of a record. A common factor on displacement is left out: it is far narrower than the priors.
    """
    sites = prior_draws(prior_sites(factors, repeats), draws, seed, priors)
    rng = np.random.default_rng((seed, 0))
    widening = np.where(rng.random(draws) < sites.get("discordant_weight", 0.0), priors.discordant_widening, 1.0)
    if "student_nu" in sites:
        widening = np.sqrt(sites["student_nu"] / rng.chisquare(sites["student_nu"]))
    found = {}
    for parameter in PARAMETERS:
        log_value = np.log(sites[f"{parameter}_group"])
        for name, factor in factors.effects(parameter).items():
            effects = rng.standard_normal((draws, factor.basis.shape[1])) @ factor.matrix[case]
            log_value = log_value + sites[f"sd_log_{parameter}_{name}"] * effects
        remainder = sites.get(f"sd_log_{parameter}_case", 0.0) * rng.standard_normal(draws)
        spread = sites.get(f"sd_log_{parameter}_repeat_over_speeds", 0.0) * rng.standard_normal(draws)
        scatter = widening * sites[f"sd_log_{parameter}_repeat"] * np.exp(spread)
        found[parameter] = np.exp(log_value + remainder + scatter * rng.standard_normal(draws))
    found["J"] = sites["sd_J"] * rng.standard_normal(draws)
    spread = sites.get("sd_log_sigma", 0.0)
    found["sigma"] = sites["sigma_typical"] * np.exp(spread * rng.standard_normal(draws))
    return found


def prior_quantities(
    factors: Factors,
    sites: tuple[str, ...],
    draws: int,
    seed: int,
    start: RecordStarts | None = None,
    parameters: Sequence[str] = PARAMETERS,
    priors: Priors = PRIORS,
) -> dict[str, Float[np.ndarray, "draws *elements"]]:
    """Return what a fit keeps, by its name, drawn from the priors alone: jointly, so that cases share their effects.

    Records' k and beta are those of usual repeats with the typical scatter, for discordant ones and the spread over
    speeds have tails without a variance: what the prior allows is wider still.

    Parameters
    ----------
    factors:
        How the cases group.
    sites:
        What the model samples of `PRIORS`: `prior_sites`, `published_sites` or `motion_sites`.
    draws, seed:
        How many; the same seed gives the same ones.
    start:
        Where each record starts; None: there are no records of force against displacement.
    parameters:
        What a case has of its own.
    """
    found: dict[str, Any] = dict(prior_draws(sites, draws, seed, priors))
    rng = np.random.default_rng((seed, 2))
    for parameter in parameters:
        cells = priors[f"{parameter}_group"].scipy().rvs((draws, len(factors.group.labels)), random_state=rng)
        found[f"{parameter}_group"] = cells
        log_case = np.log(cells)[:, factors.group.of_case]
        for name, factor in factors.effects(parameter).items():
            coordinates = rng.standard_normal((draws, factor.basis.shape[1]))
            coordinates *= found[f"sd_log_{parameter}_{name}"][:, None]
            found[f"log_{parameter}_{name}"] = coordinates @ factor.basis.T
            log_case = log_case + coordinates @ factor.matrix.T
        if f"sd_log_{parameter}_published" in found:
            # The mean of a log-normal number, as `published_model` has it.
            found[f"{parameter}_case"] = np.exp(log_case + 0.5 * found[f"sd_log_{parameter}_published"][:, None] ** 2)
            continue
        if (remainder := found.get(f"sd_log_{parameter}_case")) is not None:
            log_case = log_case + remainder[:, None] * rng.standard_normal(log_case.shape)
        found[f"{parameter}_case"] = np.exp(log_case)
        scatter = f"sd_log_{parameter}_repeat"
        if (spread := found.get(f"sd_log_{parameter}_repeat_over_speeds")) is not None:
            deviation = rng.standard_normal((draws, len(factors.speed.labels)))
            found[f"{scatter}_by_speed"] = found[scatter][:, None] * np.exp(spread[:, None] * deviation)
        usual = rng.standard_normal((draws, len(factors.of_record)))
        found[parameter] = np.exp(log_case[:, factors.of_record] + found[scatter][:, None] * usual)
    return found if start is None else found | _of_records(found, start, rng)


def _of_records(found: dict[str, Any], start: RecordStarts, rng: np.random.Generator) -> dict[str, Any]:
    """Return J, F_i, C, sigma (kN) and, where there is one, rho of each record, given the draws above them."""
    shape = found["k"].shape

    def about(middle: Any, scale: str) -> Any:
        # A record by itself is the typical one.
        return middle[:, None] + found.get(scale, np.zeros(shape[0]))[:, None] * rng.standard_normal(shape)

    J = about(np.zeros(shape[0]), "sd_J")
    F_i = start.F_0 + start.span * rng.standard_normal(shape)
    of_records = {"J": J, "F_i": F_i, "C": F_i + J - found["k"] * start.d_0}
    of_records["sigma"] = np.exp(about(np.log(found["sigma_typical"]), "sd_log_sigma"))
    if "atanh_rho_typical" in found:
        of_records["rho"] = np.tanh(about(found["atanh_rho_typical"], "sd_atanh_rho"))
    return of_records


def prior_records(
    factors: Factors,
    case: int,
    start: Start,
    draws: int = 1000,
    seed: int = 0,
    repeats: str = "mixture",
    priors: Priors = PRIORS,
) -> Float[np.ndarray, "draws points"]:
    """Return the forces (kN) of records of a case drawn from the priors alone, noise of each point included.

    Parameters
    ----------
    factors, case:
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
    parameters = prior_parameters(factors, case, draws, seed, repeats, priors)
    of_record = {name: values[:, None] for name, values in parameters.items()}
    rng = np.random.default_rng((seed, 1))
    F_i = start.F_0 + start.span * rng.standard_normal((draws, 1))
    u = start.displacement_mm - start.displacement_mm[0]
    change = equation_2_offset(u, k=of_record["k"], J=of_record["J"], beta=of_record["beta"])
    return F_i + np.asarray(change) + of_record["sigma"] * rng.standard_normal((draws, len(u)))
