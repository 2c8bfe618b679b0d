"""Simulation-based calibration: ranks of truths among their posteriors' draws, over the whole hierarchical model.

Source: Talts et al. (2018), "Validating Bayesian inference algorithms with simulation-based calibration"; Modrak et al.
(2023), "Simulation-based calibration checking for Bayesian computation: the choice of test quantities shapes
sensitivity", for the log densities of forces and of repeats among the parameters: ranks of single scales hardly show
that all repeats scatter more widely than the model takes them to.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpyro.diagnostics import effective_sample_size, split_gelman_rubin
from scipy.stats import norm

from bayes_tyre.inference.diagnostics.sampling_checks import BFMI_LEAST
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.sampling.datatree import PROBABILITIES
from bayes_tyre.studies.design import Design, calibration_design
from bayes_tyre.studies.design_fit import DesignFit, Sampled
from bayes_tyre.studies.new_records import centre_of_records, scatter_of_records
from bayes_tyre.studies.truths import NOTHING, Planted, Truths, draw_truths, noiseless_forces, study_priors
from bayes_tyre.studies.uniformity import ranks, uniformity_table

#: Of one chain's halves, the worst of everything kept: above it sampling is called failed. Halves of 40 independent
#: draws reach 1 + (F - 1) / 80, F of 1 and 78 degrees of freedom: 1.2 for one of 150 quantities in 2 % of data sets.
R_HAT_MOST = 1.2
#: Data sets whose estimates and draws are in memory at a time.
AT_ONCE = 100


class Calibration(NamedTuple):
    """What a calibration found.

    Attributes
    ----------
    table:
        A row a parameter, as `uniformity_table` gives it.
    ranks:
        A row a data set, a column a parameter; and of which element of the parameter.
    datasets:
        A row a data set: `dataset, divergences, r_hat_max, ess_min, bfmi, gradients, sampling` (`ok` or what failed).
    draws:
        How many draws truths were ranked among.
    """

    table: pd.DataFrame
    ranks: pd.DataFrame
    datasets: pd.DataFrame
    draws: int


def calibrate(
    datasets: int = 500,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda _: None,
    *,
    fit: DesignFit | None = None,
    planted: Planted = NOTHING,
) -> Calibration:
    """Return ranks and coverage of truths drawn from the priors, with noise on every point of every record.

    All data sets count, those whose sampling failed too; `Calibration.datasets` says which those are.

    Parameters
    ----------
    datasets:
        How many.
    seed:
        Of truths, noise and sampler.
    on_progress:
        Called with the number of data sets just done.
    fit:
        Compiled already, with its design and how much to sample.
    planted:
        Errors to be found: truths of another model than the one fitted.
    """
    fit = fit or DesignFit(calibration_design(), priors=study_priors())
    rng = np.random.default_rng(seed)
    tables_of_sets: list[tuple[pd.DataFrame, pd.DataFrame]] = []
    for start in range(0, datasets, AT_ONCE):
        of_truths, of_sampler = map(int, rng.integers(2**31, size=2))
        count = min(AT_ONCE, datasets - start)
        truths, force = draw_truths(fit.design, count, of_truths, fit.model.priors, planted)
        sampled = fit.sample(force, fit.approximations(force), of_sampler, on_progress)
        for values, forces in ((truths, force), (sampled.draws, force[:, None])):
            values["log_likelihood"] = log_likelihood(fit.design, values, forces)
            values["log_repeats"] = log_repeats(fit.design.factors, values, fit.model.priors.discordant_widening)
        tables_of_sets.append((rank_truths(truths, sampled.draws, start, rng), judge_sampling(sampled, start)))
    ranked, judged = (pd.concat(tables, ignore_index=True) for tables in zip(*tables_of_sets, strict=True))
    table = uniformity_table(
        {str(name): ranked[name].to_numpy() for name in ranked.columns[1:]}, fit.sampling.draws, seed
    )
    return Calibration(table, ranked, judged, fit.sampling.draws)


def rank_truths(truths: Truths, draws: dict[str, np.ndarray], first: int, rng: np.random.Generator) -> pd.DataFrame:
    """Return the rank of one element of each parameter in each data set.

    The elements of a parameter (its records, cases, levels) take turns from data set to data set: ranks of one data set
    depend on each other, ranks of different ones do not, so that those of a parameter are independent.
    """
    columns: dict[str, np.ndarray] = {}
    for name in draws:
        if name not in truths:
            continue
        values, true = draws[name].reshape(*draws[name].shape[:2], -1), truths[name].reshape(len(draws[name]), -1)
        sets = np.arange(len(true))
        element = (first + sets) % true.shape[1]
        columns[name] = ranks(true[sets, element], values[sets, :, element], rng)
    return pd.DataFrame({"dataset": first + np.arange(len(next(iter(columns.values())))), **columns})


def log_likelihood(
    design: Design, values: Truths, force_kN: Float[np.ndarray, "*#sets records points"]
) -> Float[np.ndarray, "..."]:
    """Return the log density of all forces at truths or draws, shape (sets, ...) each."""
    log_density = norm.logpdf(force_kN, noiseless_forces(design, values), values["sigma"][..., None])
    return log_density.sum(axis=(-2, -1))


def log_repeats(factors: Factors, values: Truths, widening: float = DISCORDANT_WIDENING) -> Float[np.ndarray, "..."]:
    """Return the log density of log k and log beta of all records about their cases, at truths or draws.

    As `bayes_tyre.inference.model.repeat_distribution` has its normal and its mixture, written out once more.
    """

    def about_case(wider: float) -> np.ndarray:
        log_density = np.zeros(values["k"].shape)
        for parameter in PARAMETERS:
            off = np.log(values[parameter] / centre_of_records(factors, parameter, values))
            log_density += norm.logpdf(off, 0.0, wider * scatter_of_records(factors, parameter, values))
        return log_density

    if "discordant_weight" not in values:
        return about_case(1.0).sum(axis=-1)
    weight = values["discordant_weight"][..., None]
    usual, discordant = np.log1p(-weight) + about_case(1.0), np.log(weight) + about_case(widening)
    return np.logaddexp(usual, discordant).sum(axis=-1)


def judge_sampling(sampled: Sampled, first: int) -> pd.DataFrame:
    """Return how sampling went in each data set, a row each, over everything that was kept."""
    rows = []
    # Probabilities of 0 or 1 hardly vary from draw to draw.
    judged = [values for name, values in sampled.draws.items() if name not in PROBABILITIES]
    for i in range(len(sampled.energy)):
        quantities = [values[i].reshape(len(values[i]), -1) for values in judged]
        together = np.concatenate(quantities, axis=1)[None]
        ess = float(np.nanmin(effective_sample_size(together)))
        r_hat = float(np.nanmax(split_gelman_rubin(together)))
        energy = sampled.energy[i]
        bfmi = float(np.min(np.mean(np.diff(energy) ** 2, axis=1) / np.var(energy, axis=1)))
        divergences = int(sampled.diverging[i].sum())
        bad = {"divergences": divergences > 0, "R-hat": not r_hat <= R_HAT_MOST, "energy": not bfmi >= BFMI_LEAST}
        row = {"dataset": first + i, "divergences": divergences, "r_hat_max": r_hat, "ess_min": ess, "bfmi": bfmi}
        failed = ", ".join(name for name, is_so in bad.items() if is_so) or "ok"
        rows.append(row | {"gradients": int(sampled.steps[i].sum()), "sampling": failed})
    return pd.DataFrame(rows)
