"""Fits of the odd records: all points, the source's region, and with two parameters fixed."""

import pandas as pd
import pytest
from helpers.odd_records import FIXED, LONG, RECORDS, fitted

from bayes_tyre.inference.least_squares.settings import FitSettings


@pytest.fixture(scope="module")
def fits() -> pd.DataFrame:
    return fitted(LONG | RECORDS)


@pytest.fixture(scope="module")
def thesis() -> pd.DataFrame:
    return fitted(RECORDS, FitSettings(region="thesis"))


@pytest.fixture(scope="module")
def fixed() -> pd.DataFrame:
    return fitted(RECORDS, FIXED)
