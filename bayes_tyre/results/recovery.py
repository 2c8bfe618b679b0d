"""What a result makes of records of given truth: k and beta beside the true ones, and how far off they are."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.record import FACTORS
from bayes_tyre.results.columns import numbers, texts

#: Parameters compared, with their columns in `truth.csv` and `least_squares.csv`; of motions those of `OF_MOTIONS` too.
PARAMETERS = {"k": "k_kN_per_mm", "beta": "beta_mm"}
OF_MOTIONS = {"k": "k_kN_per_mm", "x": "x_kN", "beta": "beta_mm", "m": "m_kg", "c": "c_kN_s_per_mm"}
#: What a reader of the table must know of either.
WHAT_IT_COMPARES = (
    "k: slope on flat ground, in truth and result. beta: the truth's is of the law's small-step limit. That of "
    "Equation 2 (lsq, and fit without --law small_step_limit), one step of the law, is another curve's: it differs "
    "without noise."
)
WHAT_MOTIONS_COMPARE = "k, x, beta: of the law on flat ground, m and c at the wheel centre, in truth and result alike."
WHAT_OTHER_FRICTION_COMPARES = (
    "The result's law is not the truth's: its k is the slope of its middle line on flat ground, its beta of another "
    "curve, and for its friction the truth has no number."
)
WHAT_NO_FRICTION_COMPARES = (
    "The result's law has no friction x and is not the truth's: its k is the slope of its middle line on flat ground, "
    "and its c loses what friction loses in the truth."
)


class Recovery(NamedTuple):
    """A result beside the truth.

    Attributes
    ----------
    records:
        A row a record of the truth, in its order: `record`, `status`, and for each parameter compared `<name>_true`,
        `<name>`, `<name>_error` (relative), `<name>_covered` (whether the interval holds the truth; missing for least
        squares). NaN where the result has no number.
    summary:
        A row a parameter: `parameter`, `records` with a number, `rms` and `median` of the relative errors, `interval`
        and `covered` (share of the intervals that hold the truth; NaN for least squares).
    lost:
        How many records of the truth the result has no row for.
    unknown:
        How many records of the result the truth has no row for.
    """

    records: pd.DataFrame
    summary: pd.DataFrame
    lost: int
    unknown: int

    @property
    def parameters(self) -> list[str]:
        """The parameters compared."""
        return list(self.summary["parameter"])


def of_least_squares(truth: pd.DataFrame, fits: pd.DataFrame) -> Recovery:
    """Return the rows of `least_squares.csv` beside those of `truth.csv`, matched by their factors.

    Raises
    ------
    BadInput
        If a table lacks a column, holds the factors of a record twice, or no factors are in both.
    """
    _need(fits, "least_squares.csv", *PARAMETERS.values(), "status")
    estimates = _with_key(fits, "least_squares.csv").assign(status=texts(fits, "status"))
    for name, column in PARAMETERS.items():
        estimates[name] = numbers(fits, column)
    return _beside(truth, estimates, float("nan"))


def of_posterior(truth: pd.DataFrame, repeats: pd.DataFrame) -> Recovery:
    """Return medians and intervals of `repeats.csv` beside `truth.csv`; arguments and errors as `of_least_squares`."""
    _need(repeats, "repeats.csv", "parameter", "median", "lower", "upper", "interval")
    there = set(repeats["parameter"])
    # A motion may be fitted with a law that has no friction; what both have is compared.
    compared = {name: column for name, column in OF_MOTIONS.items() if name in there} if "m" in there else PARAMETERS
    rows = {name: repeats[repeats["parameter"] == name].reset_index(drop=True) for name in compared}
    if "k" not in rows or any(of_parameter.empty for of_parameter in rows.values()):
        raise BadInput("repeats.csv: has no rows of k and beta; name what fit wrote of records")
    estimates = _with_key(rows["k"], "repeats.csv").assign(status="ok")
    for name, of_parameter in rows.items():
        block = pd.DataFrame({end: numbers(of_parameter, end) for end in ("median", "lower", "upper")})
        block.index = _keys(of_parameter)
        aligned = block.reindex(_keys(rows["k"]))
        estimates[name], estimates[f"{name}_lower"], estimates[f"{name}_upper"] = (
            aligned[end].to_numpy() for end in ("median", "lower", "upper")
        )
    return _beside(truth, estimates, float(numbers(repeats, "interval").iloc[0]))


def _beside(truth: pd.DataFrame, estimates: pd.DataFrame, interval: float) -> Recovery:
    compared = {name: column for name, column in OF_MOTIONS.items() if name in estimates}
    _need(truth, "truth.csv", *compared.values())
    true = _with_key(truth, "truth.csv")
    for name, column in compared.items():
        true[f"{name}_true"] = numbers(truth, column)
    both = true.merge(estimates.drop(columns="record"), on="key", how="left", indicator=True)
    lost = int((both["_merge"] == "left_only").sum())
    if lost == len(both):
        raise BadInput("truth.csv: has the factors of no record of the result; name the truth of these records")
    table, rows = both[["record", "status"]].copy(), []
    for name in compared:
        error = both[name] / both[f"{name}_true"] - 1
        covered = pd.Series(np.nan, index=both.index)
        if f"{name}_lower" in both:
            there = both[f"{name}_lower"].notna()
            inside = both[f"{name}_true"].between(both[f"{name}_lower"], both[f"{name}_upper"])
            covered = inside.astype(float).where(there)
        columns = {"true": both[f"{name}_true"], "": both[name], "error": error, "covered": covered}
        for end, values in columns.items():
            table[f"{name}_{end}" if end else name] = values
        errors = error.dropna()
        rms = float(np.sqrt((errors**2).mean()))
        rows.append((name, len(errors), rms, float(errors.median()), interval, float(covered.mean())))
    summary = pd.DataFrame(rows, columns=["parameter", "records", "rms", "median", "interval", "covered"])
    return Recovery(table, summary, lost, int((~estimates["key"].isin(true["key"])).sum()))


def _with_key(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return the records of a table and the key that their factors make."""
    _need(table, name, "record", *FACTORS)
    keys = _keys(table)
    if keys.duplicated().any():
        twice = texts(table, "record")[keys.duplicated()].iloc[0]
        raise BadInput(f"{name}: the factors of record {twice!r} stand twice; keep one record of each case and repeat")
    return pd.DataFrame({"record": texts(table, "record"), "key": keys})


def _keys(table: pd.DataFrame) -> pd.Series:
    """Return the factors of each row as one text, numbers written alike whatever the table made of them."""
    labels = ("configuration", "direction")
    parts = [
        texts(table, factor) if factor in labels else numbers(table, factor).map(lambda value: f"{value:.6g}")
        for factor in FACTORS
    ]
    return pd.Series([" ".join(row) for row in zip(*parts, strict=True)], index=table.index, dtype=object)


def _need(table: pd.DataFrame, name: str, *columns: str) -> None:
    missing = [column for column in columns if column not in table]
    if missing:
        raise BadInput(f"{name}: has no column {missing[0]}; name a table that has it")
