"""Leave-one-record-out cross-validation of a law over whole recordings.

The predictive density of a record's readings, given the hyperparameters, is the normal likelihood of its parameters
times the constant that makes it the density of the readings (`evidence.log_constant`), averaged over the distribution
of repeats of its case. At every draw this average has a closed form. Why not the evidence of each record: it penalises
a law for the width of the priors in every record, whereas leave-one-out conditions on the other records of the same
tyre. Both come from the same integral over a record's parameters; the result has both (`estimates.csv`,
`log_evidence`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float
from scipy.special import gammaincinv

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.diagnostics.leave_one_out.fits import thinned
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut, left_out
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.motion.hierarchy.model import Motions, Readings, fit_motions
from bayes_tyre.inference.motion.laws import motion_law
from bayes_tyre.inference.motion.record.evidence import log_average
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import draws_in_a_row, priors_of, sd_repeat_of_cases
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record import FACTORS

#: The group of a result's tree that holds the estimates of its records.
GROUP = "motion_estimates"
_OF_PARAMETERS = ("target", "log_mean", "log_variance")
_NEEDED = {"mixture": "discordant_weight", "student": "student_nu"}
#: Quantiles that a Student-t's mixture over variances is taken at.
_QUANTILES = 48


def with_motions(tree: xr.DataTree, motions: Motions) -> xr.DataTree:
    """Return a posterior with the estimates that it was fitted to; `motions_in` reads them."""
    if motions.readings is None:
        return tree
    arrays = {"rows": (("record", "row", "parameter"), motions.rows)}
    arrays |= {name: (("record", "parameter"), getattr(motions, name)) for name in _OF_PARAMETERS}
    arrays |= {name: ("record", values) for name, values in motions.readings._asdict().items()}
    labels = {"record": list(motions.factor_table["record"]), "parameter": list(motions.law.parameters)}
    with_all = tree.copy()
    with_all[GROUP] = xr.DataTree(xr.Dataset(arrays, labels))
    return with_all


def motions_in(tree: xr.DataTree) -> Motions:
    """Return the estimates that `with_motions` put into a tree.

    Raises
    ------
    BadInput
        If it holds none.
    """
    if GROUP not in tree.children:
        raise BadInput("holds no estimates of motions to compare; run motion again")
    estimates, posterior = tree[GROUP].to_dataset(), tree["posterior"].to_dataset()
    factor_table = pd.DataFrame({"record": posterior["record"].to_numpy()})
    for factor in FACTORS:
        factor_table[factor] = posterior[f"record_{factor}"].to_numpy()
    arrays = {name: estimates[name].to_numpy() for name in ("rows", *_OF_PARAMETERS)}
    readings = Readings(*(estimates[name].to_numpy() for name in Readings._fields))
    return Motions(factor_table, **arrays, law=motion_law(str(tree.attrs["law"])), readings=readings)


def leave_one_motion_out(
    tree: xr.DataTree,
    refit: SamplerSettings | None = None,
    on_refit: Callable[[str], None] = lambda _: None,
    attempt: Attempt = directly,
) -> LeaveOneOut:
    """Return how well a law predicts each record from the others; `effective_points` are of its own estimate.

    Parameters
    ----------
    tree:
        The posterior, with its estimates.
    refit, on_refit, attempt:
        As `bayes_tyre.inference.diagnostics.leave_one_out.fits.leave_one_record_out` has them.

    Raises
    ------
    BadInput
        With a single record, or where the tree holds no estimates.
    """
    motions, repeats = motions_in(tree), str(tree.attrs["repeats"])
    if len(motions.factor_table) < 2:
        raise BadInput("one record cannot be predicted from others; laws are compared on two or more")
    assert motions.readings is not None
    factors = find_factors(motions.factor_table)
    posterior = as_measured(thinned(tree))
    priors = priors_of(tree)
    density = densities(posterior, motions, factors, repeats, priors.discordant_widening)
    by_chain = density.reshape(posterior.sizes["chain"], -1, density.shape[1])

    def exactly(record: int) -> Float[np.ndarray, "chains draws"]:
        others = np.arange(len(motions.factor_table)) != record
        # Its case stays in the model, even without records.
        without = factors.only(others)
        fitted = thinned(fit_motions(_chosen(motions, others), refit, repeats, without, priors))
        alone = factors.only(~others)
        refitted = densities(fitted, _chosen(motions, ~others), alone, repeats, priors.discordant_widening)
        return refitted[:, 0].reshape(fitted.sizes["chain"], -1)

    names = tuple(motions.factor_table["record"])
    return left_out(by_chain, names, motions.readings.effective_draws, exactly if refit else None, on_refit, attempt)


def densities(
    posterior: xr.Dataset, motions: Motions, factors: Factors, repeats: str, widening: float = DISCORDANT_WIDENING
) -> Float[np.ndarray, "draws records"]:
    """Return the log density of each record's readings at each draw, with its own parameters integrated out.

    Parameters
    ----------
    posterior:
        Draws of the cases and of the standard deviations of repeats.
    motions, factors:
        The records and their cases.
    repeats:
        Distribution of repeats about their case.
    """
    assert motions.readings is not None
    of_record, rows = factors.of_record, np.asarray(motions.rows)
    case = np.stack([draws_in_a_row(posterior[f"{name}_case"]) for name in motions.law.parameters], axis=-1)
    sd_repeat = np.stack([sd_repeat_of_cases(posterior, name, factors) for name in motions.law.parameters], axis=-1)[
        :, of_record
    ]
    offset = np.asarray(motions.target) - np.einsum("rij,drj->dri", rows, np.log(case)[:, of_record])
    # With too few repeats the model has no such parameter and repeats are normal.
    kind = repeats if _NEEDED.get(repeats) in posterior else "normal"
    return _averaged(posterior, rows, offset, sd_repeat**2, kind, widening) + motions.readings.log_constant


def _averaged(
    posterior: xr.Dataset, rows: np.ndarray, offset: np.ndarray, variance: np.ndarray, kind: str, widening: float
) -> np.ndarray:
    if kind == "normal":
        return log_average(rows, offset, variance)
    if kind == "student":
        half = draws_in_a_row(posterior["student_nu"])[:, None] / 2
        # Student's t is a normal whose variance is nu over a chi-squared variable of nu degrees of freedom.
        shares = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
        precisions = gammaincinv(half, shares) / half
        each = [log_average(rows, offset, variance / precision[:, None, None]) for precision in precisions.T]
        return np.logaddexp.reduce(each, axis=0) - np.log(_QUANTILES)
    weight = draws_in_a_row(posterior["discordant_weight"])[:, None]
    usual = np.log1p(-weight) + log_average(rows, offset, variance)
    return np.logaddexp(usual, np.log(weight) + log_average(rows, offset, widening**2 * variance))


def _chosen(motions: Motions, which: np.ndarray) -> Motions:
    assert motions.readings is not None
    arrays = {name: getattr(motions, name)[which] for name in ("rows", *_OF_PARAMETERS)}
    readings = Readings(*(values[which] for values in motions.readings))
    return replace(
        motions, factor_table=motions.factor_table[which].reset_index(drop=True), **arrays, readings=readings
    )
