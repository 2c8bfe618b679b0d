"""Columns of a table as figures need them: text or finite numbers, whatever the table holds or lacks."""

import math

import numpy as np
import pandas as pd


def texts(table: pd.DataFrame, column: str) -> pd.Series:
    """Return a column as text, empty where the table has no such column or cell."""
    if column not in table:
        return pd.Series("", index=table.index, dtype=object)
    return table[column].astype(object).where(table[column].notna(), "").astype(str).str.strip()


def numbers(table: pd.DataFrame, column: str) -> pd.Series:
    """Return a column as float, NaN where the table has no such column or the cell no finite number."""
    if column not in table:
        return pd.Series(math.nan, index=table.index)
    values = pd.to_numeric(table[column], errors="coerce").astype(float)
    return values.where(np.isfinite(values))


def of_records(table: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Return `record`, `configuration` and columns of numbers, less the rows where a number is missing."""
    factors = {factor: texts(table, factor) for factor in ("record", "configuration")}
    return pd.DataFrame({**factors, **{column: numbers(table, column) for column in columns}}).dropna()
