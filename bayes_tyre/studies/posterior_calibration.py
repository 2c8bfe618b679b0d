"""Posterior calibration: simulation-based calibration around a user's own records instead of over the priors.

Given the user's records y, a draw theta' of their posterior and new records y' simulated from it by the same model,
theta' is a draw of the posterior given y and y' together: p(theta | y) p(y' | theta) is proportional to
p(theta | y, y'). So its rank among draws of that augmented posterior is uniform if the sampler is right both for y and
for y and y'. Whether y themselves follow the model does not matter: this says whether the computation can be believed
for data like them, not whether the model can.

Here y' are as many new records of the same tests. theta is everything that the posterior given y holds: what all
records share, the values of cases, specimens and days, and each record's own k, beta, J, F_i and noise. y' depend on
what is shared and on the cases alone. Their own parameters are drawn with them and, being unknowns of the augmented
posterior too, have uniform ranks as well (named `k_new` and so on).

What `fit` takes as known once it has looked at y is taken as known here: what the prior of F_i of each record is about,
and how noise differs near the start of a record and where displacements have errors. No record can tell of a factor on
displacement or force (`displacement_scale_sd`, `force_scale_sd`); it is taken out of the draws.

Source: Sailynoja, Schmitt, Burkner & Vehtari (2025), "Posterior SBC: simulation-based calibration checking conditional
on data", arXiv 2502.03279.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.inference.model.factors import INTERACTIONS
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.studies.augmented_fit import AugmentedFit, log_likelihoods
from bayes_tyre.studies.calibration import AT_ONCE, Calibration, judge_sampling, log_repeats, rank_truths
from bayes_tyre.studies.new_records import draw_new_records
from bayes_tyre.studies.truths import NOTHING, Planted, Truths
from bayes_tyre.studies.uniformity import uniformity_table

#: What the names of the parameters of new records end with.
NEW = "_new"
#: The log density of the forces of one record.
OF_RECORD = "log_likelihood_of_record"
_REST = slice(1, None)


def calibrate_around(
    truths: Truths,
    fit: AugmentedFit,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda _: None,
    *,
    planted: Planted = NOTHING,
) -> Calibration:
    """Return ranks and coverage of draws of a posterior among those of the posterior given new records too.

    All data sets count, those whose sampling failed too; `Calibration.datasets` says which those are.

    Parameters
    ----------
    truths:
        Draws of the posterior of the user's records, as `bayes_tyre.studies.new_records.posterior_truths` gives them: a
        data set each.
    fit:
        Compiled for these records.
    seed, on_progress:
        As `bayes_tyre.studies.calibration.calibrate` has them.
    planted:
        Errors to be found: new records of another model than the one fitted.
    """
    rng, datasets = np.random.default_rng(seed), len(truths["sd_J"])
    new, force = draw_new_records(fit.records, fit.model, truths, rng, planted)
    truths = truths | {name: np.concatenate([truths[name], of_new], axis=1) for name, of_new in new.items()}
    tables: list[tuple[pd.DataFrame, pd.DataFrame]] = []
    for start in range(0, datasets, AT_ONCE):
        here = slice(start, start + AT_ONCE)
        sampled = fit.sample(force[here], int(rng.integers(2**31)), on_progress)
        both = {
            name: np.concatenate([values[here][:, None], _as_on_disk(fit, name, sampled.draws[name])], axis=1)
            for name, values in truths.items()
        }
        quantities = ranked_quantities(fit, force[here], both)
        of_truths, of_draws = ({name: values[:, which] for name, values in quantities.items()} for which in (0, _REST))
        tables.append((rank_truths(of_truths, of_draws, start, rng), judge_sampling(sampled, start)))
    ranked, judged = (pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True))
    by_parameter = {str(name): ranked[name].to_numpy() for name in ranked.columns[1:]}
    return Calibration(uniformity_table(by_parameter, fit.sampling.draws, seed), ranked, judged, fit.sampling.draws)


def _as_on_disk(fit: AugmentedFit, name: str, draws: np.ndarray) -> np.ndarray:
    """Return draws of a site without the levels whose effect is zero by construction, as `posterior.nc` has them."""
    dim = QUANTITIES[name][0]
    return draws[..., getattr(fit.factors, dim).free] if dim in INTERACTIONS else draws


def ranked_quantities(fit: AugmentedFit, force_kN: Float[np.ndarray, "sets records points"], values: Truths) -> Truths:
    """Return what is ranked of parameters, shape (sets, draws, ...): these, and log densities of forces and repeats.

    Parameters
    ----------
    fit:
        Of the user's records.
    force_kN:
        Of the new records, by set.
    values:
        By name; those of the user's records come before those of the new ones, which have a name of their own in what
        is returned.
    """
    of_record = [
        log_likelihoods(fit.augmented(force), fit.model.law, {name: each[i] for name, each in values.items()})
        for i, force in enumerate(force_kN)
    ]
    quantities: Truths = {"log_likelihood": np.sum(of_record, axis=-1)}
    if "student_nu" not in values:
        quantities["log_repeats"] = log_repeats(fit.factors, values, fit.model.priors.discordant_widening)
    for name, each in {**values, OF_RECORD: np.stack(of_record)}.items():
        if name == OF_RECORD or QUANTITIES[name][0] == "record":
            quantities[name], quantities[f"{name}{NEW}"] = np.split(each, 2, axis=-1)
        else:
            quantities[name] = each
    return quantities
