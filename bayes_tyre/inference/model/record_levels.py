"""What records share across cases: the specimen that was tested, the day, and covariates such as a pressure.

A case has a value for the average specimen of its configuration, on an average day, at the mean of each covariate. What
a record's own specimen, day and covariates add to the logarithms of k and beta is its offset. Without it, records of
one tyre count as if each had been made on a tyre of its own, and the intervals of two types of tyre are too narrow.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Array, Bool, Float, Int

from bayes_tyre.errors import BadInput

#: Groupings of records, in the order in which their effects are sampled; and the name of all slopes.
LEVELS, COVARIATE = ("specimen", "day"), "covariate"


class Level(NamedTuple):
    """One grouping of the records.

    Attributes
    ----------
    labels:
        The levels met in the data, sorted.
    of_record:
        Which of them each record belongs to.
    """

    labels: tuple[str, ...]
    of_record: Int[np.ndarray, " records"]


class Covariates(NamedTuple):
    """Numbers that k and beta may change with.

    Attributes
    ----------
    names:
        Their columns.
    values:
        Of each record, less their mean and over their standard deviation.
    sd:
        That standard deviation over the records, in the unit of each column.
    """

    names: tuple[str, ...]
    values: Float[np.ndarray, "records covariates"]
    sd: Float[np.ndarray, " covariates"]


@dataclass(frozen=True)
class RecordLevels:
    """The groupings and covariates that a model has; none unless the user names their columns.

    Attributes
    ----------
    groupings:
        By name of `LEVELS`.
    covariates:
        None: there are none.
    """

    groupings: Mapping[str, Level] = field(default_factory=dict)
    covariates: Covariates | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """What adds to the logarithms of a record's values, as their effects are named: ``log_k_specimen``."""
        return (*self.groupings, *([COVARIATE] if self.covariates is not None else []))

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        """The labels along each of `names`."""
        covariates = {} if self.covariates is None else {COVARIATE: self.covariates.names}
        return {name: level.labels for name, level in self.groupings.items()} | covariates

    def only(self, records: Bool[np.ndarray, " records"] | Int[np.ndarray, " chosen"]) -> "RecordLevels":
        """Return the levels of some of the records, by a mask or by their numbers; all levels stay."""
        groupings = {name: level._replace(of_record=level.of_record[records]) for name, level in self.groupings.items()}
        covariates = self.covariates and self.covariates._replace(values=self.covariates.values[records])
        return replace(self, groupings=groupings, covariates=covariates)

    def offset(self, effects: Callable[[str], Array | np.ndarray]) -> Float[Array | np.ndarray, "*draws records"]:
        """Return what they add to the logarithm of a parameter of each record.

        `effects` gives the effects of one of `names` on it, shape (*draws, levels); a slope is per standard deviation.
        """
        parts = [effects(name)[..., level.of_record] for name, level in self.groupings.items()]
        if self.covariates is not None:
            parts.append(effects(COVARIATE) @ self.covariates.values.T)
        return sum(parts[1:], parts[0])


#: No levels: a record adds nothing to its case but its own scatter.
NO_LEVELS = RecordLevels()


def find_levels(
    table: pd.DataFrame, configurations: Sequence[str], groupings: Mapping[str, str | None], covariates: Sequence[str]
) -> RecordLevels:
    """Return the levels of the records of a checked table.

    Parameters
    ----------
    table:
        The record table.
    configurations:
        Of each record, in order of first appearance: a specimen is one of its configuration, so that tyre 1 of two
        types is two tyres.
    groupings:
        Column of each of `LEVELS`; None: the model has no such level.
    covariates:
        Columns of the covariates.

    Raises
    ------
    BadInput
        For a column that the table lacks or that varies within a record, an empty cell, a covariate that is no number
        or the same in all records, and a grouping of one level.
    """
    levels = {}
    for name, column in groupings.items():
        if column is None:
            continue
        values = [_text(value) for value in _by_record(table, column, name)]
        if name == "specimen":
            values = [f"{of} {value}".strip() for of, value in zip(configurations, values, strict=True)]
        labels = tuple(sorted(set(values)))
        if len(labels) < 2:
            raise BadInput(f"column {column}: all records have {values[0]!r}; leave --{name} {column} out")
        levels[name] = Level(labels, np.array([labels.index(value) for value in values]))
    return RecordLevels(levels, _covariates(table, covariates) if covariates else None)


def _covariates(table: pd.DataFrame, columns: Sequence[str]) -> Covariates:
    numbers = []
    for column in columns:
        values = pd.to_numeric(_by_record(table, column, COVARIATE), errors="coerce").to_numpy(dtype=float)
        if not np.isfinite(values).all():
            raise BadInput(f"column {column}: not a number in every record; --{COVARIATE} takes a column of numbers")
        if np.ptp(values) == 0:
            raise BadInput(f"column {column}: all records have {values[0]:g}; leave --{COVARIATE} {column} out")
        numbers.append(values)
    values = np.stack(numbers, axis=1)
    sd = values.std(axis=0)
    return Covariates(tuple(columns), (values - values.mean(axis=0)) / sd, sd)


def _by_record(table: pd.DataFrame, column: str, option: str) -> pd.Series:
    """Return the one value of a column in each record."""
    if column not in table:
        raise BadInput(f"column {column}: not in the record table; --{option} names one of its columns")
    by_record = table.groupby("record", sort=False)[column]
    if (several := by_record.nunique(dropna=False) > 1).any():
        record = several.index[several.to_numpy()][0]
        raise BadInput(f"record {record!r}, column {column}: varies within the record; give each record one value")
    values = by_record.first()
    if (empty := values.isna() | (values.astype(str).str.strip() == "")).any():
        raise BadInput(f"record {values.index[empty.to_numpy()][0]!r}, column {column}: is empty; mend the cell")
    return values


def _text(value: object) -> str:
    return f"{value:.15g}" if isinstance(value, float) else str(value).strip()
