"""Least squares of a record table: a row a record with estimates, standard errors, rmse and status."""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from bayes_tyre.batch import NARROWEST, Batch, batches
from bayes_tyre.inference.least_squares import estimate as ls
from bayes_tyre.inference.least_squares.parameters import PARAMETERS
from bayes_tyre.inference.least_squares.settings import FitSettings
from bayes_tyre.inference.least_squares.status import status, unfittable
from bayes_tyre.record import FACTORS
from bayes_tyre.record_table import carry_extras, origin_of, record_extras, record_factors

COLUMNS = {"k": "k_kN_per_mm", "C": "C_kN", "beta": "beta_mm", "d_i": "d_i_mm", "F_i": "F_i_kN"}
NUMBERS = [name for column in COLUMNS.values() for name in (column, f"{column}_se")]
#: The source's choices (appendix B5): the first 70 % of a record, its line from 20 % on, beta from 0.1 mm.
THESIS_SHARE, THESIS_LINE_FROM, THESIS_BETA_MM = 0.7, 0.2, 0.1


def fit_records(
    table: pd.DataFrame, settings: FitSettings | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> pd.DataFrame:
    """Return the least-squares estimate of every record, a row each, in the order of the table.

    Above the table, memory is that of one batch a core and of the rows returned.

    Parameters
    ----------
    table:
        A checked record table (`bayes_tyre.record_table.check_record_table`).
    settings:
        Settings of the fit; by default k, C and beta over all points.
    on_progress:
        Called with the number of records just fitted.

    Returns
    -------
    pandas.DataFrame
        `record`, the factors (empty where the table has none), each parameter with its standard error
        (`k_kN_per_mm`, `k_kN_per_mm_se`, ...), `rmse_kN`, `points`, `status` (``ok`` or a reason), the table's
        further columns (``given_<name>`` where one of these has the name; numbers that vary within a record are
        averaged), `origin`.

    Warns
    -----
    UserWarning
        For further columns whose text varies within a record: they are left out.
    """
    settings = settings or FitSettings()
    rows = []
    for fitted in _fit_batches(table, settings):
        rows.append(fitted)
        on_progress(len(fitted))
    fits = record_factors(table).merge(pd.concat(rows), on="record", how="left", validate="1:1")
    for factor in FACTORS:
        if factor not in fits:
            fits[factor] = ""
    fits["origin"] = table.drop_duplicates("record")["origin"].to_numpy() if "origin" in table else origin_of(table)
    columns = ["record", *FACTORS, *NUMBERS, "rmse_kN", "points", "status"]
    return carry_extras(fits[columns], record_extras(table)).assign(origin=fits["origin"])


def _fit_batches(table: pd.DataFrame, settings: FitSettings) -> Iterator[pd.DataFrame]:
    """Yield the fits of each batch, in order; as many batches run at a time as there are cores."""
    lengths = np.bincount(pd.factorize(table["record"])[0])
    if settings.region == "thesis":
        lengths = np.ceil(THESIS_SHARE * lengths).astype(int)
    shapes: dict[int, tuple[int, int]] = {}
    running: deque[Future[pd.DataFrame]] = deque()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for batch in batches(table):
            width = batch.present.shape[1]
            is_first = width not in shapes
            if is_first:
                # Only the columns that a record of this width uses. A smaller last batch is padded to the shape of
                # those before it, because each shape is compiled.
                used = int(lengths[lengths <= width].max())
                shapes[width] = len(batch.records), min(width, -(-used // NARROWEST) * NARROWEST)
            running.append(pool.submit(_fit_batch, batch, settings, shapes[width]))
            # The first of a shape compiles, which two at a time would do twice.
            while running and (is_first or len(running) >= (os.cpu_count() or 1)):
                yield running.popleft().result()
        while running:
            yield running.popleft().result()


def _fit_batch(batch: Batch, settings: FitSettings, shape: tuple[int, int]) -> pd.DataFrame:
    """Return the fits of a batch, padded to `shape` (records, points) for the solver."""
    used = batch.present
    given = np.full((len(batch.records), len(PARAMETERS)), np.nan)
    if settings.region == "thesis":
        points = np.ceil(THESIS_SHARE * batch.points).astype(int)
        used = used & (np.arange(used.shape[1]) < points[:, None])
        given[:, [ls.K, ls.C]] = _thesis_line(batch, points)
        given[:, ls.BETA] = THESIS_BETA_MM
    for name, value in settings.start.items():
        given[:, PARAMETERS.index(name)] = value
    estimated = np.full_like(given, np.nan)
    # A given start far from the data may end where the RSS is flat: a start estimated from the data is fitted too, and
    # the better fit counts.
    start = np.stack([estimated] if np.isnan(given).all() else [given, estimated], axis=1)
    fixed = np.broadcast_to([settings.fix.get(name, np.nan) for name in PARAMETERS], given.shape)
    bounds = np.array([settings.bounds.get(name, (-np.inf, np.inf)) for name in PARAMETERS]).T
    low, high = (np.broadcast_to(side, given.shape) for side in bounds)
    batch, used = batch.narrowed(shape[1]), used[:, : shape[1]]
    arrays = (batch.displacement_mm, batch.force_kN, used, fixed, start, *((low, high) if settings.bounds else ()))
    short = shape[0] - len(batch.records)
    problems = ls.Problem(*(jnp.asarray(_padded(array, short) if short else array) for array in arrays))
    estimates = jax.device_get(ls.estimate_batch(problems, settings.free_indices))
    estimate = ls.Estimate(*(field[: len(batch.records)] for field in estimates))
    return _rows(batch, used, estimate, settings, bounds)


def _padded(array: np.ndarray, short: int) -> np.ndarray:
    """Return an array with its last row repeated `short` times more."""
    return np.concatenate([array, array[-1:].repeat(short, axis=0)])


def _thesis_line(batch: Batch, points: np.ndarray) -> Float[np.ndarray, "records 2"]:
    """Return k (kN/mm) and C (kN) of the line from 20 % of the record to the last used point."""
    rows = np.arange(len(points))
    begin = np.ceil(THESIS_LINE_FROM * batch.points).astype(int) - 1
    d, F = batch.displacement_mm, batch.force_kN
    with np.errstate(over="ignore", invalid="ignore"):  # of records that cannot be fitted
        run = d[rows, points - 1] - d[rows, begin]
        k = np.divide(F[rows, points - 1] - F[rows, begin], run, out=np.ones_like(run), where=run != 0)
        return np.stack([k, F[rows, begin] - k * d[rows, begin]], axis=1)


def _rows(
    batch: Batch,
    used: Bool[np.ndarray, "records points"],
    estimate: ls.Estimate,
    settings: FitSettings,
    bounds: Float[np.ndarray, "2 5"],
) -> pd.DataFrame:
    reasons = unfittable(batch, used, len(settings.free_indices))
    unfit = (reasons != "") | ~estimate.converged
    points = used.sum(axis=1)
    numbers = np.stack([estimate.value, estimate.standard_error], axis=2).reshape(len(points), -1)
    rows = pd.DataFrame(np.where(unfit[:, None], np.nan, numbers), columns=pd.Index(NUMBERS))
    rows.insert(0, "record", batch.records)
    rows["rmse_kN"] = np.where(unfit, np.nan, np.sqrt(estimate.rss / points))
    rows["points"] = points
    rows["status"] = status(batch, used, estimate, bounds, reasons, settings.free_indices)
    return rows
