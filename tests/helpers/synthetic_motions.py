"""Estimates of motions made from a known truth, in numpy alone: what a hierarchy over them must give back."""

from typing import NamedTuple

import numpy as np
from helpers.hand_made_posteriors import grid
from jaxtyping import Float

from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.record import CASE_FACTORS

#: Logarithms of k, x - k beta, beta, m and c of the single axle; what the dual one's and unloading differ by.
BASE = np.log([1.8, 0.2, 0.08, 300.0, 0.0015])
DUAL, UNLOADING = np.array([0.6, 0.3, 0.1, 0.5, 0.2]), np.array([0.03, 0.05, -0.1, 0.0, 0.1])
#: Scatter of repeats, and standard deviations of a record's estimate, of the logarithms.
SCATTER = np.array([0.01, 0.04, 0.04, 0.005, 0.05])
SD = np.array([0.004, 0.03, 0.03, 0.01, 0.05])


class Made(NamedTuple):
    """Estimates, and the truth of their records and cases; logarithms, shape (records, 5) and (cases, 5)."""

    motions: Motions
    records: Float[np.ndarray, "records 5"]
    cases: Float[np.ndarray, "cases 5"]


def make(seed: int, odd: int | None = None, silent: int | None = None, repeats: int = 3) -> Made:
    """Return estimates of two configurations, two speeds and two directions.

    Parameters
    ----------
    seed:
        Of truth and errors.
    odd, silent:
        A record whose parameters are 40 % off its case's; one whose readings say nothing of its damping.
    repeats:
        Records a case.
    """
    rng = np.random.default_rng(seed)
    factor_table = grid(repeats=repeats)
    cases = factor_table[list(CASE_FACTORS)].drop_duplicates()
    of_record = factor_table.groupby(list(CASE_FACTORS), sort=False).ngroup().to_numpy()
    dual, unloading = cases["configuration"].to_numpy() == "dual", cases["direction"].to_numpy() == "unloading"
    of_cases = BASE + dual[:, None] * DUAL + unloading[:, None] * UNLOADING
    of_cases = of_cases + [0.02, 0.05, 0.05, 0.0, 0.05] * rng.standard_normal(of_cases.shape)
    records = of_cases[of_record] + SCATTER * rng.standard_normal((len(factor_table), 5))
    if odd is not None:
        records[odd] += 0.35
    # x - k beta and beta trade against each other, as those of motions do.
    correlation = np.eye(5)
    correlation[1, 2] = correlation[2, 1] = -0.7
    covariance = correlation * SD[:, None] * SD
    estimates = records + rng.multivariate_normal(np.zeros(5), covariance, len(factor_table))
    rows = np.broadcast_to(np.linalg.inv(np.linalg.cholesky(covariance)), (len(factor_table), 5, 5)).copy()
    if silent is not None:
        rows[silent, 4] = 0.0
    target = np.einsum("rij,rj->ri", rows, estimates)
    variance = np.broadcast_to(SD**2, estimates.shape).copy()
    return Made(Motions(factor_table, rows, target, estimates, variance), records, of_cases)
