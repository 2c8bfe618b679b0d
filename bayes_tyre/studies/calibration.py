"""Simulation-based calibration: ranks of truths among their posteriors' draws, over the whole hierarchical model.

Source: Talts et al. (2018), "Validating Bayesian inference algorithms with simulation-based calibration". Ranks of
single scales hardly show that all repeats scatter more widely than the model takes them to: what else is ranked is in
`bayes_tyre.studies.ranked_quantities`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import pandas as pd
from numpyro.diagnostics import effective_sample_size, split_gelman_rubin

from bayes_tyre.inference.diagnostics.sampling_checks import BFMI_LEAST
from bayes_tyre.inference.sampling.datatree import PROBABILITIES, QUANTITIES
from bayes_tyre.studies.design_fit import Sampled, SimulatedSets, Thinned
from bayes_tyre.studies.outlier_calibration import draw_discordant, outlier_calibration
from bayes_tyre.studies.ranked_quantities import OF_RECORD, Hierarchy, with_derived
from bayes_tyre.studies.truths import NOTHING, Planted, Truths
from bayes_tyre.studies.uniformity import ranks, uniformity_table

#: Of one chain's halves, the worst of everything kept: above it sampling is called failed. Halves of 40 independent
#: draws reach 1 + (F - 1) / 80, F of 1 and 78 degrees of freedom: 1.2 for one of 150 quantities in 2 % of data sets.
R_HAT_MOST = 1.2
#: What the names of parameters of new records end with.
NEW = "_new"
#: Data sets whose estimates and draws are in memory at a time.
AT_ONCE = 100


@runtime_checkable
class SimulatedFit(Protocol):
    """The fit of one model, to data sets of which as many can be simulated as one likes."""

    @property
    def hierarchy(self) -> Hierarchy:
        """What is above the records."""
        ...

    @property
    def sampling(self) -> Thinned:
        """How much is sampled of each data set."""
        ...

    def simulated(
        self, sets: int, of_truths: int, of_sampler: int, planted: Planted, on_progress: Callable[[int], None]
    ) -> SimulatedSets:
        """Return so many data sets and what was sampled of each; the seeds are of truths and noise, and of draws."""
        ...


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
    outliers:
        As `bayes_tyre.studies.outlier_calibration.outlier_calibration` gives it; no row where no record can be
        discordant.
    """

    table: pd.DataFrame
    ranks: pd.DataFrame
    datasets: pd.DataFrame
    draws: int
    outliers: pd.DataFrame


def calibrate(
    datasets: int = 500,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda _: None,
    *,
    fit: SimulatedFit,
    planted: Planted = NOTHING,
) -> Calibration:
    """Return ranks and coverage of truths drawn from the priors, with noise on every reading.

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
        Compiled already, with what is tested and how much to sample.
    planted:
        Errors to be found: truths of another model than the one fitted.
    """
    rng, lots = np.random.default_rng(seed), list[Lot]()
    for start in range(0, datasets, AT_ONCE):
        seeds = rng.integers(2**31, size=2)
        sets = fit.simulated(min(AT_ONCE, datasets - start), int(seeds[0]), int(seeds[1]), planted, on_progress)
        lots.append(calibrate_lot(fit.hierarchy, sets.truths, sets.sampled, sets.of_records, start, rng))
    return joined(lots, fit.sampling.draws, seed)


class Lot(NamedTuple):
    """What is known of some data sets: ranks, how sampling went, and which records are discordant, by probability.

    Attributes
    ----------
    ranks, datasets:
        As those of `Calibration`.
    predicted, discordant:
        Shape (sets, records), of no record where the model has no discordant ones: the posterior mean of the
        probability, and whether it is.
    """

    ranks: pd.DataFrame
    datasets: pd.DataFrame
    predicted: np.ndarray
    discordant: np.ndarray


def calibrate_lot(
    hierarchy: Hierarchy,
    truths: Truths,
    sampled: Sampled,
    of_records: Sequence[np.ndarray],
    first: int,
    rng: np.random.Generator,
    new: int = 0,
) -> Lot:
    """Return the ranks of truths of some data sets.

    Parameters
    ----------
    hierarchy:
        Above the records.
    truths, sampled:
        The truths, and what was sampled of each data set.
    of_records:
        Log densities of the readings of each record, at truths and at draws.
    first:
        Number of the first of these data sets.
    rng:
        Of ranks among equal draws, and of which records are discordant.
    new:
        How many records, the last ones, have names of their own (`k_new`) among what is ranked.
    """
    true, draws = (
        _new_apart(with_derived(hierarchy, values, of_record), new)
        for values, of_record in zip((truths, sampled.draws), of_records, strict=True)
    )
    ranks, datasets = rank_truths(true, draws, first, rng), judge_sampling(sampled, first)
    if "discordant_weight" not in truths:
        return Lot(ranks, datasets, np.zeros((len(ranks), 0)), np.zeros((len(ranks), 0), dtype=bool))
    predicted = sampled.draws["outlier_probability"].mean(axis=1)
    return Lot(ranks, datasets, predicted, draw_discordant(hierarchy, truths, rng))


def _new_apart(values: Truths, new: int) -> Truths:
    """Return values by name, those of the last `new` records by names of their own."""
    if not new:
        return values
    named: Truths = {}
    for name, each in values.items():
        of_records = name == OF_RECORD or QUANTITIES.get(name, (None, ""))[0] == "record"
        named |= {name: each[..., :-new], f"{name}{NEW}": each[..., -new:]} if of_records else {name: each}
    return named


def joined(lots: Sequence[Lot], draws: int, seed: int) -> Calibration:
    """Return the calibration of the data sets of all lots, `draws` each."""
    ranks = pd.concat([lot.ranks for lot in lots], ignore_index=True)
    datasets = pd.concat([lot.datasets for lot in lots], ignore_index=True)
    predicted = np.concatenate([lot.predicted for lot in lots])
    discordant = np.concatenate([lot.discordant for lot in lots])
    by_parameter = {str(name): ranks[name].to_numpy() for name in ranks.columns[1:]}
    outliers = outlier_calibration(predicted, discordant)
    return Calibration(uniformity_table(by_parameter, draws, seed), ranks, datasets, draws, outliers)


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
