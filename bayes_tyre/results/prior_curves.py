"""Records drawn from the priors alone, made to start where typical records of the data do."""

from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.prior_predictive import Start, prior_records
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.datatree import priors_of
from bayes_tyre.inference.sampling.hierarchical_fit import record_batch
from bayes_tyre.record_table import record_factors

#: The most panels; records of the data, and of the prior, in each; points of a prior record.
PANELS, REAL, DRAWN, POINTS = 6, 5, 40, 80
_BAND_DRAWS = 2000


class PriorPanel(NamedTuple):
    """Prior records beside the data of one configuration and direction.

    Attributes
    ----------
    like:
        The record of the data that the prior records are like in start and travel: that of median travel.
    configuration, direction:
        Its words, empty where the data do not say.
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


def prior_panels(tree: xr.DataTree, table: pd.DataFrame, interval: float = 0.95, seed: int = 0) -> list[PriorPanel]:
    """Return prior records for each configuration and direction of a record table, six at most.

    Parameters
    ----------
    tree, table:
        The posterior, which knows by which words k and beta vary, and the record table.
    interval:
        Probability inside the bands, noise of each point included.
    seed:
        Of the prior records.
    """
    factor_table = record_factors(table)
    factors = _levels(tree, table, factor_table)
    cells = factors.group.of_case[factors.of_record]
    travel = table.groupby("record", sort=False)["displacement_mm"].agg(np.ptp).to_numpy()
    panels = []
    for cell in range(min(PANELS, len(factors.group.labels))):
        of_group = np.flatnonzero(cells == cell)
        like = int(of_group[np.argsort(travel[of_group], kind="stable")[(len(of_group) - 1) // 2]])
        repeats = str(tree.attrs.get("repeats", "mixture"))
        panels.append(_panel(table, factor_table, factors, like, interval, seed + cell, repeats, priors_of(tree)))
    return panels


def _levels(tree: xr.DataTree, table: pd.DataFrame, factor_table: pd.DataFrame) -> Factors:
    """Return the levels that the posterior was fitted with: a slope over actual initial loads has one `load`."""
    posterior = tree["posterior"].to_dataset()
    slope = "log_k_load" in posterior and posterior.sizes["load"] == 1
    return find_factors(factor_table, record_batch(table).force_kN[:, 0] if slope else None)


def _panel(
    table: pd.DataFrame,
    factor_table: pd.DataFrame,
    factors: Factors,
    like: int,
    interval: float,
    seed: int,
    repeats: str,
    priors: Priors,
) -> PriorPanel:
    case = int(factors.of_record[like])
    names = factor_table["record"].tolist()
    same = [names[i] for i in np.flatnonzero(factors.of_record == case) if i != like]
    shown = [names[like], *same][:REAL]
    points = table.loc[table["record"].isin(shown), ["record", "displacement_mm", "force_kN"]]
    mine = points[points["record"] == names[like]]
    d, F = mine["displacement_mm"].to_numpy(), mine["force_kN"].to_numpy()
    start = Start(float(F[0]), float(np.abs(F - F[0]).max()), _grid(d))
    forces = prior_records(factors, case, start, _BAND_DRAWS, seed, repeats, priors)
    lower, upper = np.quantile(forces, [(1.0 - interval) / 2.0, (1.0 + interval) / 2.0], axis=0)
    curves = pd.DataFrame(
        {
            "record": np.arange(DRAWN).repeat(POINTS),
            "displacement_mm": np.tile(start.displacement_mm, DRAWN),
            "force_kN": forces[:DRAWN].ravel(),
        }
    )
    band = pd.DataFrame({"displacement_mm": start.displacement_mm, "lower_kN": lower, "upper_kN": upper})
    known = {
        word: str(factor_table[word].iloc[like]) if word in factor_table else ""
        for word in ("configuration", "direction")
    }
    return PriorPanel(names[like], known["configuration"], known["direction"], curves, band, points)


def _grid(d: np.ndarray) -> np.ndarray:
    """Return displacements (mm) from a record's first point to its farthest, dense at the start where beta shows."""
    far = d[np.argmax(np.abs(d - d[0]))]
    return d[0] + (far - d[0]) * np.linspace(0.0, 1.0, POINTS) ** 2
