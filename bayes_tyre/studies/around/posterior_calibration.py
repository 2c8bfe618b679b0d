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
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.model.factors import INTERACTIONS
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.studies.around.augmented_fit import AugmentedFit, augmented, log_likelihoods
from bayes_tyre.studies.around.new_records import draw_new_records
from bayes_tyre.studies.calibration import AT_ONCE, Calibration, Lot, calibrate_lot, joined
from bayes_tyre.studies.ranked_quantities import Hierarchy
from bayes_tyre.studies.truths import NOTHING, Planted, Truths


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
        Draws of the posterior of the user's records, a data set each, as
        `bayes_tyre.studies.around.new_records.posterior_truths` gives them.
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
    sites = prior_sites(fit.factors, fit.model.repeats, fit.model.correlation)
    hierarchy, lots = Hierarchy(fit.factors, fit.model.priors, sites), list[Lot]()
    for start in range(0, datasets, AT_ONCE):
        here = slice(start, start + AT_ONCE)
        sampled = fit.sample(force[here], int(rng.integers(2**31)), on_progress)
        sampled = sampled._replace(draws={name: _as_on_disk(fit, name, each) for name, each in sampled.draws.items()})
        true = {name: values[here] for name, values in truths.items()}
        densities = _log_likelihoods(fit, force[here], true, sampled.draws)
        lots.append(calibrate_lot(hierarchy, true, sampled, densities, start, rng, force.shape[1]))
    return joined(lots, fit.sampling.draws, seed)


def _log_likelihoods(
    fit: AugmentedFit, new_force_kN: Float[np.ndarray, "sets records points"], truths: Truths, draws: Truths
) -> tuple[Float[np.ndarray, "sets both"], Float[np.ndarray, "sets draws both"]]:
    """Return the log density of the forces of each record, the user's and the new ones, at truths and at draws.

    Point by point, whatever the sampler took.
    """
    model = replace(fit.model, likelihood="direct")
    names = [name for name in ("F_i", "J", "k", "beta", "sigma", "rho") if name in truths]
    values = {name: np.concatenate([truths[name][:, None], draws[name]], axis=1) for name in names}
    rows = []
    for i, force in enumerate(new_force_kN):
        likelihood = augmented(fit.records, force, model).likelihood
        assert isinstance(likelihood, Likelihood)  # noise is never a Student-t here
        rows.append(log_likelihoods(likelihood, {name: each[i] for name, each in values.items()}))
    return np.stack(rows)[:, 0], np.stack(rows)[:, 1:]


def _as_on_disk(fit: AugmentedFit, name: str, draws: np.ndarray) -> np.ndarray:
    """Return draws of a site without the levels whose effect is zero by construction, as `posterior.nc` has them."""
    dim = QUANTITIES.get(name, (None, ""))[0]
    return draws[..., getattr(fit.factors, dim).free] if dim in INTERACTIONS else draws
