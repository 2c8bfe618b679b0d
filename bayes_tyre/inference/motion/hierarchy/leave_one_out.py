"""How well a law predicts a motion that it has not seen: leave-one-record-out over whole recordings.

A record's readings have, under the populations of the others, the density that its estimate gives: the normal
likelihood of its parameters, times the constant that makes it the density of the readings
(`motion_evidence.log_constant`), averaged over what its case and the scatter of repeats let these parameters be. That
average is in closed form at every draw. Why this and not the evidence of each record by itself: the evidence charges a
law for the width of priors of one record after the other, and so for what a lab says of tyres in general; left out, a
record charges it for what the other records of the same tyre could have told. Both come from the same integral over
all that is unknown in a record, and both stand in the result (`estimates.csv`, `log_evidence`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float
from scipy.special import gammaincinv

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out import LeaveOneOut, left_out, thinned
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.motion.hierarchy.model import Motions, Readings, fit_motions
from bayes_tyre.inference.motion.laws import motion_law
from bayes_tyre.inference.motion.record.evidence import log_average
from bayes_tyre.inference.sampling.datatree import priors_of
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record import FACTORS

#: The group of a result's tree that holds what its records said.
GROUP = "motion_estimates"
_OF_PARAMETERS = ("target", "log_mean", "log_variance")
_NEEDED = {"mixture": "discordant_weight", "student": "student_nu"}
#: Quantiles that a Student-t's mixture over variances is taken at.
_QUANTILES = 48


def with_motions(tree: xr.DataTree, motions: Motions) -> xr.DataTree:
    """Return a posterior with the estimates that it was fitted to, for `motions_in`."""
    if motions.readings is None:
        return tree
    kept = {"rows": (("record", "row", "parameter"), motions.rows)}
    kept |= {name: (("record", "parameter"), getattr(motions, name)) for name in _OF_PARAMETERS}
    kept |= {name: ("record", values) for name, values in motions.readings._asdict().items()}
    labels = {"record": list(motions.factor_table["record"]), "parameter": list(motions.law.parameters)}
    with_all = tree.copy()
    with_all[GROUP] = xr.DataTree(xr.Dataset(kept, labels))
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
    kept, posterior = tree[GROUP].to_dataset(), tree["posterior"].to_dataset()
    factor_table = pd.DataFrame({"record": posterior["record"].to_numpy()})
    for word in FACTORS:
        factor_table[word] = posterior[f"record_{word}"].to_numpy()
    arrays = {name: kept[name].to_numpy() for name in ("rows", *_OF_PARAMETERS)}
    readings = Readings(*(kept[name].to_numpy() for name in Readings._fields))
    return Motions(factor_table, **arrays, law=motion_law(str(tree.attrs["law"])), readings=readings)


def leave_one_motion_out(
    tree: xr.DataTree, refit: SamplerSettings | None = None, on_refit: Callable[[str], None] = lambda _: None
) -> LeaveOneOut:
    """Return how well a law predicts each record from the others; `effective_points` are of its own estimate.

    Parameters
    ----------
    tree:
        The posterior, with its estimates.
    refit, on_refit:
        As `bayes_tyre.inference.diagnostics.leave_one_out.leave_one_record_out` has them.

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
    posterior = thinned(tree)
    priors = priors_of(tree)
    density = densities(posterior, motions, factors, repeats, priors.discordant_widening)
    by_chain = density.reshape(posterior.sizes["chain"], -1, density.shape[1])

    def exactly(record: int) -> float:
        others = np.arange(len(motions.factor_table)) != record
        # Its case stays, if only as its words.
        without = replace(factors, of_record=factors.of_record[others])
        fitted = fit_motions(_chosen(motions, others), refit, repeats, without, priors)
        alone = replace(factors, of_record=factors.of_record[~others])
        found = densities(thinned(fitted), _chosen(motions, ~others), alone, repeats, priors.discordant_widening)[:, 0]
        return float(np.logaddexp.reduce(found) - np.log(len(found)))

    names = tuple(motions.factor_table["record"])
    return left_out(by_chain, names, motions.readings.effective_draws, exactly if refit else None, on_refit)


def densities(
    posterior: xr.Dataset,
    motions: Motions,
    factors: Factors,
    repeats: str,
    widening: float = DISCORDANT_WIDENING,
) -> Float[np.ndarray, "draws records"]:
    """Return the log density of each record's readings under the populations of each draw, its own parameters gone.

    Parameters
    ----------
    posterior:
        Of cases and scatters.
    motions, factors:
        The records, and the cases that they are of.
    repeats:
        How repeats scatter about their case.
    """
    assert motions.readings is not None
    of_record, rows = factors.of_record, np.asarray(motions.rows)
    case = np.stack([_flat(posterior, f"{name}_case") for name in motions.law.parameters], axis=-1)
    scatter = np.stack([_scatter(posterior, name, factors) for name in motions.law.parameters], axis=-1)[:, of_record]
    off = np.asarray(motions.target) - np.einsum("rij,drj->dri", rows, np.log(case)[:, of_record])
    # Too few repeats to judge any: the model had no such number, and its repeats scatter normally.
    kind = repeats if _NEEDED.get(repeats) in posterior else "normal"
    return _averaged(posterior, rows, off, scatter**2, kind, widening) + motions.readings.log_constant


def _averaged(
    posterior: xr.Dataset, rows: np.ndarray, off: np.ndarray, variance: np.ndarray, kind: str, widening: float
) -> np.ndarray:
    if kind == "normal":
        return log_average(rows, off, variance)
    if kind == "student":
        half = _flat(posterior, "student_nu")[:, None] / 2
        # A t is a normal whose variance is nu over a chi-squared number of nu degrees.
        shares = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
        precisions = gammaincinv(half, shares) / half
        each = [log_average(rows, off, variance / of[:, None, None]) for of in precisions.T]
        return np.logaddexp.reduce(each, axis=0) - np.log(_QUANTILES)
    weight = _flat(posterior, "discordant_weight")[:, None]
    usual = np.log1p(-weight) + log_average(rows, off, variance)
    return np.logaddexp(usual, np.log(weight) + log_average(rows, off, widening**2 * variance))


def _scatter(posterior: xr.Dataset, parameter: str, factors: Factors) -> Float[np.ndarray, "draws cases"]:
    """Return the scatter of repeats of each case."""
    by_speed = f"sd_log_{parameter}_repeat_by_speed"
    if by_speed in posterior:
        return _flat(posterior, by_speed)[:, factors.speed.of_case]
    return np.repeat(_flat(posterior, f"sd_log_{parameter}_repeat")[:, None], len(factors.cases), axis=1)


def _flat(posterior: xr.Dataset, name: str) -> np.ndarray:
    values = posterior[name].transpose("chain", "draw", ...).to_numpy()
    return values.reshape(-1, *values.shape[2:])


def _chosen(motions: Motions, which: np.ndarray) -> Motions:
    assert motions.readings is not None
    arrays = {name: getattr(motions, name)[which] for name in ("rows", *_OF_PARAMETERS)}
    readings = Readings(*(values[which] for values in motions.readings))
    return replace(
        motions, factor_table=motions.factor_table[which].reset_index(drop=True), **arrays, readings=readings
    )
