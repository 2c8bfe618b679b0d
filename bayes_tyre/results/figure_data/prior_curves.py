"""Records drawn from the priors alone, made to start where typical records of the data do."""

from typing import NamedTuple

import jax
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float, Int

from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.models import records_model
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.model.prior_predictive import PriorDraws, draw_prior, prior_forces, without_points
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.datatree import model_of
from bayes_tyre.record_table import record_factors
from bayes_tyre.results.cases.untested import has_slope
from bayes_tyre.results.equal_tailed import median_lower_upper

#: The most panels; records of the data, and of the prior, in each; points of a prior record.
PANELS, REAL, DRAWN, POINTS = 6, 5, 40, 80
_BAND_DRAWS = 2000
_DRAWN_SITES = ("F_i", "J", "k", "beta", "sigma", "rho", "noise_nu")


class PriorPanel(NamedTuple):
    """Prior records beside the data of one configuration and direction.

    Attributes
    ----------
    like:
        The record of the data that the prior records are like in start and travel: that of median travel.
    configuration, direction:
        Its factors, empty where the data do not say.
    curves:
        Of the prior: `record` (a number), `displacement_mm`, `force_kN`.
    band:
        Of the prior: `displacement_mm`, `lower_kN`, `upper_kN`.
    points:
        Of the data, records of the same case: `record`, `displacement_mm`, `force_kN`.
    """

    like: str
    configuration: str
    direction: str
    curves: pd.DataFrame
    band: pd.DataFrame
    points: pd.DataFrame


class _Drawn(NamedTuple):
    """Draws of the prior of some records, by their numbers in the data, and the law that they follow."""

    records: Int[np.ndarray, " drawn"]
    draws: PriorDraws
    law: str

    def forces(
        self, record: int, displacement_mm: Float[np.ndarray, " points"], seed: int
    ) -> Float[np.ndarray, "draws points"]:
        """Return the forces (kN) of a record of the data at these displacements, a row a draw."""
        return prior_forces(self.draws, int(np.searchsorted(self.records, record)), displacement_mm, seed, self.law)


def prior_panels(tree: xr.DataTree, table: pd.DataFrame, interval: float = 0.95, seed: int = 0) -> list[PriorPanel]:
    """Return prior records for each configuration and direction of a record table, six at most.

    Parameters
    ----------
    tree, table:
        The posterior, which knows by which factors k and beta vary, and the record table.
    interval:
        Probability inside the bands, noise of each point included.
    seed:
        Of the prior records.
    """
    factor_table = record_factors(table)
    factors = _levels(tree, table, factor_table)
    group_of_record = factors.group.of_case[factors.of_record]
    travel = table.groupby("record", sort=False)["displacement_mm"].agg(np.ptp).to_numpy()
    likes = []
    for group in range(min(PANELS, len(factors.group.labels))):
        of_group = np.flatnonzero(group_of_record == group)
        likes.append(int(of_group[np.argsort(travel[of_group], kind="stable")[(len(of_group) - 1) // 2]]))
    drawn = _draw(tree, table, factors, _drawn_records(factors, likes), seed)
    return [
        _panel(table, factor_table, factors, like, interval, drawn, seed + group) for group, like in enumerate(likes)
    ]


def _levels(tree: xr.DataTree, table: pd.DataFrame, factor_table: pd.DataFrame) -> Factors:
    """Return the levels that the posterior was fitted with: a slope over actual initial loads has one `load`."""
    slope = has_slope(tree["posterior"].to_dataset())
    return find_factors(factor_table, record_batch(table).force_kN[:, 0] if slope else None)


def _drawn_records(factors: Factors, likes: list[int]) -> Int[np.ndarray, " drawn"]:
    """Return the numbers of all records in the cases of these ones, and in those that keep the model the same.

    A second record decides whether noise differs. The prior of all records of an archive would take gigabytes.
    """
    cases = [*factors.of_record[likes], factors.of_record[0], factors.of_record[-1]]
    return np.flatnonzero(np.isin(factors.of_record, cases))


def _draw(
    tree: xr.DataTree, table: pd.DataFrame, factors: Factors, records: Int[np.ndarray, " drawn"], seed: int
) -> _Drawn:
    """Return draws of the prior of these records' parameters, with the model that the posterior was fitted with."""
    data, model = without_points(record_data(record_batch(table))), model_of(tree)
    options = {"repeats": model.repeats, "noise": model.correlation, "law": model.law, "priors": model.priors}
    of_records = {"data": jax.tree.map(lambda leaf: leaf[records], data), "factors": factors.only(records)}
    arguments = {**of_records, **options, "observed": False}
    return _Drawn(records, draw_prior(records_model, arguments, _DRAWN_SITES, _BAND_DRAWS, seed), model.law)


def _panel(
    table: pd.DataFrame,
    factor_table: pd.DataFrame,
    factors: Factors,
    like: int,
    interval: float,
    drawn: _Drawn,
    seed: int,
) -> PriorPanel:
    case = int(factors.of_record[like])
    names = factor_table["record"].tolist()
    same = [names[i] for i in np.flatnonzero(factors.of_record == case) if i != like]
    shown = [names[like], *same][:REAL]
    points = table.loc[table["record"].isin(shown), ["record", "displacement_mm", "force_kN"]]
    mine = points[points["record"] == names[like]]
    grid = _grid(mine["displacement_mm"].to_numpy())
    forces = drawn.forces(like, grid, seed)
    _, lower, upper = median_lower_upper(forces, interval)
    curves = pd.DataFrame(
        {
            "record": np.arange(DRAWN).repeat(POINTS),
            "displacement_mm": np.tile(grid, DRAWN),
            "force_kN": forces[:DRAWN].ravel(),
        }
    )
    band = pd.DataFrame({"displacement_mm": grid, "lower_kN": lower, "upper_kN": upper})
    group_factors = {
        factor: str(factor_table[factor].iloc[like]) if factor in factor_table else ""
        for factor in ("configuration", "direction")
    }
    return PriorPanel(names[like], group_factors["configuration"], group_factors["direction"], curves, band, points)


def _grid(d: np.ndarray) -> np.ndarray:
    """Return displacements (mm) from a record's first point to its farthest, dense at the start where beta shows."""
    far = d[np.argmax(np.abs(d - d[0]))]
    return d[0] + (far - d[0]) * np.linspace(0.0, 1.0, POINTS) ** 2
