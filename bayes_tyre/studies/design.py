"""What is tested in a study: which cases, how often, and at which displacements."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.record_data import RecordData
from bayes_tyre.record import CASE_FACTORS, Case

#: Travel of every record, mm, and the displacement it starts from.
TRAVEL_MM, START_MM = 5.0, 10.0
#: Points of a record, and of a weak one.
POINTS, WEAK_POINTS = 40, 10


@dataclass(frozen=True)
class Design:
    """The same records, whatever their forces will be.

    Attributes
    ----------
    factor_table:
        A row a record: `record`, the factors of its case, `repeat`.
    factors:
        How the cases group.
    u:
        Shape (records, points): displacement from the start, mm; points lie densest where beta shows.
    """

    factor_table: pd.DataFrame
    factors: Factors
    u: Float[np.ndarray, "records points"]

    @property
    def start_kN(self) -> Float[np.ndarray, " records"]:
        """The nominal force that each record starts from: what its prior of F_i is about."""
        return self.factor_table["initial_load_kN"].to_numpy(dtype=float)

    @property
    def span_kN(self) -> Float[np.ndarray, " records"]:
        """The nominal change of force of each record: the standard deviation of that prior."""
        return self.factor_table["step_kN"].abs().to_numpy(dtype=float)

    def batch(self, force_kN: Float[np.ndarray, "records points"]) -> Batch:
        """Return the records with these forces (kN) as the fit takes them."""
        everywhere = np.ones(self.u.shape, dtype=bool)
        return Batch(tuple(self.factor_table["record"]), START_MM + self.u, force_kN, everywhere)

    def nominal(self, data: RecordData) -> RecordData:
        """Return the records with the prior of F_i about the nominal start instead of the first, noisy force.

        No truths could be drawn from a prior that depends on the data: it would count the first point twice.
        """
        return data._replace(F_0=jnp.asarray(self.start_kN), span=jnp.asarray(self.span_kN))


def design(cases: list[Case], repeats: int, points: int) -> Design:
    """Return the design in which each case is repeated, with so many points a record."""
    rows = [(*case, repeat) for case in cases for repeat in range(1, repeats + 1)]
    factor_table = pd.DataFrame(rows, columns=[*CASE_FACTORS, "repeat"])
    factor_table.insert(0, "record", [f"{case.label}({repeat})" for case in cases for repeat in range(1, repeats + 1)])
    way = np.sign(factor_table["step_kN"].to_numpy(dtype=float))
    return Design(
        factor_table, find_factors(factor_table), way[:, None] * TRAVEL_MM * np.linspace(0.0, 1.0, points) ** 2
    )


def calibration_design(repeats: int = 3, points: int = POINTS) -> Design:
    """Return 8 cases x so many repeats x points: the fewest cases in which every kind of term of the model exists.

    Group means, effects of speed, of step, of direction x step and of configuration x speed, a remainder of each case,
    scatter by speed, discordant repeats. Initial load enters as speed does.
    """
    cases = [
        Case("single", direction, speed, 20.0, sign * step)
        for direction, sign in (("loading", 1), ("unloading", -1))
        for speed, step in ((0.0, 5.0), (0.0, 10.0), (25.0, 10.0))
    ]
    cases += [Case("dual", "loading", speed, 20.0, 10.0) for speed in (0.0, 25.0)]
    return design(cases, repeats, points)


def outlier_design() -> Design:
    """Return 12 cases x 3 repeats x 40 points: two directions, two speeds, three initial loads."""
    cases = [
        Case("single", direction, speed, load, sign * 10.0)
        for direction, sign in (("loading", 1), ("unloading", -1))
        for speed in (0.0, 25.0)
        for load in (10.0, 20.0, 30.0)
    ]
    return design(cases, repeats=3, points=POINTS)
