"""Estimates of records by an average over force laws: their evidence by configuration, and other weights for them.

Nothing is fitted: what each law's fit of a record said is kept in its part.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from bayes_tyre.inference.motion.hierarchy.law_pooling import weights_of_record
from bayes_tyre.inference.motion.laws import MotionLaw
from bayes_tyre.inference.motion.record.law_average import joined_status, mixture_moments
from bayes_tyre.record_table import origin_of
from bayes_tyre.results.columns import texts
from bayes_tyre.results.comparison.law_weights import Evidence, laws_table
from bayes_tyre.rig.axle import Rig
from bayes_tyre.workflow.raw.estimate_columns import (
    LAW_ROWS,
    LOG_EVIDENCE,
    WEIGHT,
    LawRow,
    Posterior,
    posterior_columns,
)

#: The method of an estimate whose evidence is the mean of importance weights; else it is Laplace's approximation.
_RELIABLE = "importance"


def weighted(table: pd.DataFrame, rigs: Sequence[Rig], law: MotionLaw) -> tuple[pd.DataFrame, pd.DataFrame | None]:
    """Return rows of parts, of a law that pools records with its weights; and of an average `laws.csv`, else None.

    `rigs` has the rig of each row.
    """
    if not law.averaged:
        return table, None
    laws = laws_table(evidence_of(table, law), origin_of(table))
    return reweighted(table, rigs, law, laws) if law.pools else table, laws


def evidence_of(table: pd.DataFrame, law: MotionLaw) -> Evidence:
    """Return the evidence of records, rows of parts, by the laws of an average."""
    log_evidence = table[[f"{LOG_EVIDENCE}{name}" for name in law.averaged]].to_numpy(float)
    reliable = np.array(
        [
            [any(one["law"] == name and one["columns"]["method"] == _RELIABLE for one in rows) for name in law.averaged]
            for rows in table[LAW_ROWS]
        ]
    )
    own = table[[f"{WEIGHT}{name}" for name in law.averaged]].to_numpy(float)
    configuration = texts(table, "configuration").to_numpy(str)
    return Evidence(law.averaged, log_evidence, reliable, own, configuration)


def reweighted(table: pd.DataFrame, rigs: Sequence[Rig], law: MotionLaw, laws: pd.DataFrame) -> pd.DataFrame:
    """Return rows of parts with the estimates that other weights of the laws give.

    A record without a usable fit by any law that has a weight keeps its own. Columns `weight_...` stay: they are what
    the record by itself says.

    Parameters
    ----------
    table, rigs:
        Rows of parts, and the rig of each.
    law:
        The average.
    laws:
        `laws.csv`: the weight of each law by configuration.
    """
    configurations = texts(table, "configuration")
    rows = []
    for row, rig, configuration in zip(table.to_dict("records"), rigs, configurations, strict=True):
        weights = laws[laws["configuration"] == configuration].set_index("law")["weight"]
        rows.append({**row, **_changed(rig, [LawRow.read(each) for each in row[LAW_ROWS]], weights, law)})
    return pd.DataFrame(rows, columns=table.columns)


def _changed(rig: Rig, fits: Sequence[LawRow], pooled: "pd.Series[float]", law: MotionLaw) -> dict[str, Any]:
    """Return the columns of a record that these weights change; none where no fit has a weight."""
    weights = weights_of_record(pooled[[fit.law for fit in fits]].to_numpy(float), _usable(fits))
    if weights is None:
        return {}
    kept = [(fit, weight) for fit, weight in zip(fits, weights, strict=True) if weight > 0]
    posterior = _mixture([fit.posterior for fit, _ in kept], np.array([weight for _, weight in kept]))
    most_probable, _ = max(kept, key=lambda pair: pair[1])
    return {**most_probable.columns, **posterior_columns(rig, posterior, law)}


def _usable(fits: Sequence[LawRow]) -> Bool[np.ndarray, " laws"]:
    """Return whether each fit has moments."""
    covariances = [fit.posterior.log_covariance for fit in fits]
    return np.array([np.isfinite(each).all() and np.linalg.eigvalsh(each)[0] > 0 for each in covariances], bool)


def _mixture(posteriors: Sequence[Posterior], weights: Float[np.ndarray, " laws"]) -> Posterior:
    mean, covariance = mixture_moments(
        weights,
        np.array([each.log_mean for each in posteriors]),
        np.array([each.log_covariance for each in posteriors]),
    )
    narrower = weights @ np.array([each.narrower_without_force for each in posteriors])
    log_evidence = np.logaddexp.reduce(np.log(weights) + np.array([each.log_evidence for each in posteriors]))
    status = joined_status(weights, [each.status for each in posteriors])
    prior = posteriors[int(np.argmax(weights))].prior
    return Posterior(mean, covariance, narrower, float(log_evidence), status, prior)
