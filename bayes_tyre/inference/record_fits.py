"""From a record table to a row a record: which points and parameters are used, and what the fit is worth in words."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.inference import least_squares as ls
from bayes_tyre.record import WORDS, Batch, batches, origin_of, record_words

REGIONS = ("all", "thesis")
COLUMNS = {"k": "k_kN_per_mm", "C": "C_kN", "beta": "beta_mm", "d_i": "d_i_mm", "F_i": "F_i_kN"}
#: The source's choices (appendix B5): the first 70 % of a record, its line from 20 % on, beta from 0.1 mm.
THESIS_KEPT, THESIS_LINE_FROM, THESIS_BETA_MM = 0.7, 0.2, 0.1
#: Displacements and forces above this are no measurements, and their sums of squares overflow.
LARGEST = 1e100


@dataclass(frozen=True)
class FitSettings:
    """What to fit, and from where.

    Attributes
    ----------
    region:
        ``all`` points with starts found from the data, or ``thesis``: the source's first 70 % and its starts.
    fix, start:
        Values by parameter name (`k` kN/mm, `C` kN, `beta` mm, `d_i` mm, `F_i` kN).
    free:
        Parameters to fit beside k, C and beta; d_i and F_i are the record's first point unless freed.

    Raises
    ------
    BadInput
        For unknown names, values that are not finite, a beta that is not positive, a parameter both fixed
        and freed or started, and nothing left to fit.
    """

    region: str = "all"
    fix: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.region not in REGIONS:
            raise BadInput(f"region {self.region!r} is unknown; use {' or '.join(REGIONS)}")
        for name in (*self.fix, *self.free, *self.start):
            if name not in ls.PARAMETERS:
                raise BadInput(f"parameter {name!r} is unknown; use one of {', '.join(ls.PARAMETERS)}")
        for name, value in (*self.fix.items(), *self.start.items()):
            if not np.isfinite(value) or (name == "beta" and value <= 0):
                raise BadInput(f"{name}={value}: give a finite number{', above 0' if name == 'beta' else ''}")
        for name in self.fix:
            if name in self.free or name in self.start:
                raise BadInput(f"{name} is fixed and also freed or started; choose one")
        for name in self.start:
            if ls.PARAMETERS.index(name) not in self.free_indices:
                raise BadInput(f"{name} has a start but is not fitted; add --free {name}")
        if not self.free_indices:
            raise BadInput("every parameter is fixed; leave at least one to fit")

    @property
    def free_indices(self) -> tuple[int, ...]:
        """Indices into `least_squares.PARAMETERS` of what is fitted."""
        free = {"k", "C", "beta", *self.free} - set(self.fix)
        return tuple(i for i, name in enumerate(ls.PARAMETERS) if name in free)


def fit_records(
    table: pd.DataFrame,
    settings: FitSettings | None = None,
    on_progress: Callable[[int], None] = lambda _: None,
) -> pd.DataFrame:
    """Return the least-squares estimate of every record, a row each, in the order of the table.

    Parameters
    ----------
    table:
        A checked record table (`bayes_tyre.record.check_record_table`).
    settings:
        What to fit; by default k, C and beta over all points.
    on_progress:
        Called with the number of records just done.

    Returns
    -------
    pandas.DataFrame
        `record`, the words (empty where the table has none), each parameter with its standard error
        (`k_kN_per_mm`, `k_kN_per_mm_se`, ...), `rmse_kN`, `points`, `status` (``ok`` or a reason), `origin`.
    """
    settings = settings or FitSettings()
    rows = []
    for batch in batches(table):
        rows.append(_fit_batch(batch, settings))
        on_progress(len(batch.records))
    fits = record_words(table).merge(pd.concat(rows), on="record", how="left", validate="1:1")
    for word in WORDS:
        if word not in fits:
            fits[word] = ""
    fits["origin"] = (
        fits["record"].map(table.drop_duplicates("record").set_index("record")["origin"])
        if ("origin" in table)
        else origin_of(table)
    )
    numbers = [name for column in COLUMNS.values() for name in (column, f"{column}_se")]
    return fits[["record", *WORDS, *numbers, "rmse_kN", "points", "status", "origin"]]


def _fit_batch(batch: Batch, settings: FitSettings) -> pd.DataFrame:
    used = batch.present
    given = np.full((len(batch.records), 5), np.nan)
    if settings.region == "thesis":
        kept = np.ceil(THESIS_KEPT * batch.points).astype(int)
        used = used & (np.arange(used.shape[1]) < kept[:, None])
        given[:, [ls.K, ls.C]] = _thesis_line(batch, kept)
        given[:, ls.BETA] = THESIS_BETA_MM
    for name, value in settings.start.items():
        given[:, ls.PARAMETERS.index(name)] = value
    found = np.full_like(given, np.nan)
    # A start far from the data may end in a flat place: the data's own start runs beside it, the better fit counts.
    start = np.stack([found] if np.isnan(given).all() else [given, found], axis=1)
    fixed = np.full_like(given, np.nan)
    for name, value in settings.fix.items():
        fixed[:, ls.PARAMETERS.index(name)] = value
    problem = ls.Problem(*map(jnp.asarray, (batch.displacement_mm, batch.force_kN, used, fixed, start)))
    estimate = jax.device_get(ls.estimate_batch(problem, settings.free_indices))
    return _rows(batch, used, estimate, settings)


def _thesis_line(batch: Batch, kept: np.ndarray) -> np.ndarray:
    """Return k (kN/mm) and C (kN) of the line from 20 % of the record to the last point kept, shape (records, 2)."""
    rows = np.arange(len(kept))
    begin = np.ceil(THESIS_LINE_FROM * batch.points).astype(int) - 1
    d, F = batch.displacement_mm, batch.force_kN
    with np.errstate(over="ignore", invalid="ignore"):  # records of absurd numbers are refused by `_hopeless`
        run = d[rows, kept - 1] - d[rows, begin]
        k = np.divide(F[rows, kept - 1] - F[rows, begin], run, out=np.ones_like(run), where=run != 0)
        return np.stack([k, F[rows, begin] - k * d[rows, begin]], axis=1)


def _rows(batch: Batch, used: np.ndarray, estimate: ls.Estimate, settings: FitSettings) -> pd.DataFrame:
    points = used.sum(axis=1)
    hopeless = _hopeless(batch, used, settings)
    unfit = np.array([reason != "" for reason in hopeless]) | ~estimate.converged
    rows = pd.DataFrame({"record": batch.records})
    for i, column in enumerate(COLUMNS.values()):
        rows[column] = np.where(unfit, np.nan, estimate.value[:, i])
        rows[f"{column}_se"] = np.where(unfit, np.nan, estimate.standard_error[:, i])
    rows["rmse_kN"] = np.where(unfit, np.nan, np.sqrt(estimate.rss / points))
    rows["points"] = points
    rows["status"] = [hopeless[i] or _status(batch, used, estimate, i) for i in range(len(rows))]
    return rows


def _hopeless(batch: Batch, used: np.ndarray, settings: FitSettings) -> list[str]:
    """Return, a record, why there is nothing to fit; empty where there is."""
    unknowns = len(settings.free_indices)
    reasons = []
    for d, F, use in zip(batch.displacement_mm, batch.force_kN, used, strict=True):
        if use.sum() <= unknowns:
            reasons.append(f"too few points: {use.sum()} for {unknowns} parameters")
        elif d[use].min() == d[use].max():
            reasons.append("no travel: the displacement is constant")
        elif max(np.abs(d[use]).max(), np.abs(F[use]).max()) > LARGEST:
            reasons.append(f"numbers above {LARGEST:g}: too large to be squared, check the cells")
        else:
            reasons.append("")
    return reasons


def _status(batch: Batch, used: np.ndarray, estimate: ls.Estimate, row: int) -> str:
    """Return ``ok``, or what the estimate is not worth."""
    if not estimate.converged[row]:
        return "did not converge: give a --start nearer to the data, or fix a parameter"
    reasons = []
    use = used[row]
    d, F = batch.displacement_mm[row][use], batch.force_kN[row][use]
    if np.sign(F[-1] - F[0]) * np.sign(d[-1] - d[0]) < 0:
        reasons.append("force falls as displacement grows: check the signs")
    lost = [name for name, gone in zip(ls.PARAMETERS, estimate.undetermined[row], strict=True) if gone]
    if estimate.beta_open_below[row] and estimate.beta_open_above[row]:
        reasons.append("beta not determined: any value fits")
    elif estimate.beta_open_below[row]:
        reasons.append("beta not determined: only an upper bound, it lies below the spacing of the first points")
    elif estimate.beta_open_above[row]:
        reasons.append("beta not determined: only a lower bound, beyond the travel it trades against k")
    elif lost:
        reasons.append(f"{', '.join(lost)} not determined by this record")
    return "; ".join(reasons) or "ok"
