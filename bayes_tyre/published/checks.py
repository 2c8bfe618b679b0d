"""Checks of every published value that can be recomputed, and the errata found.

A value agrees if it lies within half a unit of the last printed digit, plus `ROUNDING` because some means are exact
ties. Values far below one are therefore compared in the power of ten in which they are printed.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from bayes_tyre.plain_text import number_in
from bayes_tyre.published import tables
from bayes_tyre.published.load_deflection import returned_slopes
from bayes_tyre.published.recompute import GROUP, SPEED_GROUP, corrected_values, group_means, numbers_outside_tables
from bayes_tyre.published.tables import CHARACTERISTIC_DEFLECTION, HALF_DIGIT, STIFFNESS, printed_digits
from bayes_tyre.record import CASE_FACTORS, Case

COLUMNS = ("quantity", "source", "kind", "published", "recomputed", "tolerance", "agrees")
ROUNDING = 1e-6
_PARAMETERS = {STIFFNESS: ("k (kN/mm)", "Table 9"), CHARACTERISTIC_DEFLECTION: ("beta (mm)", "Table 11")}


def published_check(case_means: pd.DataFrame) -> pd.DataFrame:
    """Return all checks: `recomputed_rows`, `round_trip_rows` of the given case means, `erratum_rows`.

    Parameters
    ----------
    case_means:
        The factors of the case, `k_kN_per_mm` (kN/mm) and `beta_mm` (mm), a row a case, of reconstructed records.

    Returns
    -------
    Columns `quantity, source, kind, published, recomputed, tolerance, agrees`, in the unit the quantity names.
    """
    return pd.concat([recomputed_rows(), round_trip_rows(case_means), erratum_rows()], ignore_index=True)


def recomputed_rows() -> pd.DataFrame:
    """Return the checks of kind `recomputed`: means, geometry, section, calibration, spreads (columns: `COLUMNS`).

    Sources: Tables 8 to 11, Eq. 8 and 9, appendices B1, B2, B3, B5. Where the value was not printed but stated by
    this project, `source` says so.
    """
    means = _mean_rows(tables.case_means(), "recomputed")
    printed = tables.printed_numbers()
    rows = [
        _row(_with_unit(name, printed[name].unit), printed[name].source, printed[name].value, value)
        for name, value in numbers_outside_tables().items()
    ]
    return _frame([*means, *rows])


def round_trip_rows(case_means: pd.DataFrame) -> pd.DataFrame:
    """Return the checks of kind `round trip`: estimates from records that were reconstructed from printed values.

    Parameters
    ----------
    case_means:
        The factors of the case, `k_kN_per_mm` (kN/mm) and `beta_mm` (mm), a row a case. A missing case is NaN and does
        not agree, nor do the means that it belongs to.

    Returns
    -------
    124 rows, columns as `COLUMNS`. From records: the 96 values of Tables 9 and 11, their 8 means, the 10 model values
    of Table 10. From load-deflection tests, through rig geometry and line fit alone: the 10 test values of Table 10,
    with which the source makes no numerical comparison.

    Raises
    ------
    KeyError, pandas.errors.MergeError
        If a column is missing, or a case stands twice.
    """
    returned = case_means[[*CASE_FACTORS, STIFFNESS, CHARACTERISTIC_DEFLECTION]]
    cases = tables.case_means()[list(CASE_FACTORS)]
    returned = cases.merge(returned, on=list(CASE_FACTORS), how="left", validate="one_to_one")
    rows = []
    for printed, parameter in (
        (tables.stiffness(), STIFFNESS),
        (tables.characteristic_deflection(), CHARACTERISTIC_DEFLECTION),
    ):
        rows += _compare(printed, returned, CASE_FACTORS, parameter, "", "round trip")
    tests = tables.model_and_tests().query("kind == 'tests'").drop(columns="kind")
    slopes = _compare(tests, returned_slopes(), SPEED_GROUP, STIFFNESS, "tests ", "round trip")
    return _frame([*rows, *_mean_rows(returned, "round trip"), *slopes])


def erratum_rows() -> pd.DataFrame:
    """Return the checks of kind `erratum`: printed values that do not recompute (columns: `COLUMNS`).

    `published` is what is printed (NaN where the source prints no number), `recomputed` ours, and `agrees` says
    whether ours is the corrected value that `data/published/errata.csv` records, within that value's digits. Errata
    without a number (a unit) stand in that file only.
    """
    values = corrected_values()
    rows = []
    for erratum in tables.errata().itertuples():
        if not _is_number(erratum.recomputed):  # a unit: nothing to recompute
            continue
        source, _, quantity = str(erratum.item).partition(": ")
        source = f"{source} (errata.csv corrects it to {erratum.recomputed})"
        published = float(str(erratum.printed)) if _is_number(erratum.printed) else np.nan
        row = _row(quantity, source, str(erratum.recomputed), values[str(erratum.item)], "erratum")
        rows.append({**row, "published": published})
    return _frame(rows)


def _row(quantity: str, source: str, printed: str, recomputed: float, kind: str = "recomputed") -> dict:
    return _judged(quantity, source, kind, float(printed), recomputed, printed_digits(printed))


def _judged(quantity: str, source: str, kind: str, published: float, recomputed: float, half_digit: float) -> dict:
    tolerance = half_digit + ROUNDING
    agrees = bool(abs(recomputed - published) <= tolerance)
    return dict(zip(COLUMNS, (quantity, source, kind, published, recomputed, tolerance, agrees), strict=True))


def _frame(rows: Sequence[dict]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _with_unit(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def _is_number(text: object) -> bool:
    return number_in(str(text)) is not None


def _compare(
    printed: pd.DataFrame, recomputed: pd.DataFrame, keys: Sequence[str], parameter: str, prefix: str, kind: str
) -> list[dict]:
    both = printed.merge(recomputed, on=list(keys), how="left", suffixes=("", "_recomputed"), validate="one_to_one")
    symbol = _PARAMETERS[parameter][0]
    return [
        _judged(
            f"{prefix}{symbol}, {_label([row[key] for key in keys])}",
            row["source"],
            kind,
            row[parameter],
            row[f"{parameter}_recomputed"],
            row[HALF_DIGIT],
        )
        for row in both.to_dict("records")
    ]


def _label(factors: Sequence) -> str:
    if len(factors) == len(CASE_FACTORS):
        return Case(*factors).label
    configuration, direction, *speed = factors
    return f"{configuration} {direction}" + (f" at {speed[0]:g} km/h" if speed else "")


def _mean_rows(cases: pd.DataFrame, kind: str) -> list[dict]:
    rows = []
    for parameter in (STIFFNESS, CHARACTERISTIC_DEFLECTION):
        ours = group_means(cases, GROUP, parameter)
        rows += _compare(tables.means(parameter), ours, GROUP, parameter, "mean ", kind)
    model = tables.model_and_tests().query("kind == 'model'").drop(columns="kind")
    ours = group_means(cases, SPEED_GROUP, STIFFNESS)
    return rows + _compare(model, ours, SPEED_GROUP, STIFFNESS, "model ", kind)
