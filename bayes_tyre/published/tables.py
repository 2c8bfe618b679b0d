"""The published tables as typed data frames, each value with half a unit of its last printed digit beside it."""

from typing import Literal, NamedTuple

import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.record import CASE_FACTORS, NUMBER_COLUMNS
from bayes_tyre.rig.calibration import mend_signs

STIFFNESS = "k_kN_per_mm"
CHARACTERISTIC_DEFLECTION = "beta_mm"
#: Half a unit of the last printed digit, in the unit of its column.
HALF_DIGIT = "half_digit"

_MEANS = {STIFFNESS: "table_09_means", CHARACTERISTIC_DEFLECTION: "table_11_means"}


class Printed(NamedTuple):
    """A number printed outside the tables: its unit, its digits, and where it stands."""

    unit: str
    value: str
    source: str


def printed_digits(text: str) -> float:
    """Return half a unit of the last printed digit: how far the value may lie from what is printed.

    Parameters
    ----------
    text:
        A decimal number as printed, without exponent.

    Raises
    ------
    ValueError
        If the text is no such number.

    Examples
    --------
    >>> printed_digits("1.440")
    0.0005
    >>> printed_digits("2191")
    0.5
    """
    float(text)
    whole, _, decimals = text.strip().partition(".")
    if not (whole + decimals).lstrip("+-").isdigit():
        raise ValueError(f"{text!r} is no decimal number without exponent")
    return float(f"5e-{len(decimals) + 1}")


def as_printed(name: str) -> pd.DataFrame:
    """Return a file of `data/published` as text, cell by cell as printed.

    Parameters
    ----------
    name:
        Such as ``"table_01_tyres_and_axles"``; the files are listed in `data/published/README.md`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    """
    return pd.read_csv(data_path(f"published/{name}.csv"), dtype=str, keep_default_na=False, encoding="utf-8")


def _typed(name: str, value: str) -> pd.DataFrame:
    table = as_printed(name)
    half_digit = [printed_digits(text) for text in table[value]]
    for column in (value, *NUMBER_COLUMNS):
        if column in table:
            table[column] = table[column].astype(float)
    if "repeat" in table:
        table["repeat"] = table["repeat"].astype(int)
    table.insert(list(table.columns).index(value) + 1, HALF_DIGIT, half_digit)
    return table


def stiffness() -> pd.DataFrame:
    """Return Table 9, 48 rows: the factors of the case, `k_kN_per_mm`, `half_digit` (kN/mm), `source`."""
    return _typed("table_09_stiffness", STIFFNESS)


def characteristic_deflection() -> pd.DataFrame:
    """Return Table 11, 48 rows: the factors of the case, `beta_mm`, `half_digit` (mm), `source`."""
    return _typed("table_11_characteristic_deflection", CHARACTERISTIC_DEFLECTION)


def case_means() -> pd.DataFrame:
    """Return Tables 9 and 11 merged, 48 rows: the factors of the case, `k_kN_per_mm`, `beta_mm`."""
    k = stiffness()[[*CASE_FACTORS, STIFFNESS]]
    beta = characteristic_deflection()[[*CASE_FACTORS, CHARACTERISTIC_DEFLECTION]]
    return k.merge(beta, on=list(CASE_FACTORS), validate="one_to_one")


def means(parameter: Literal["k_kN_per_mm", "beta_mm"]) -> pd.DataFrame:
    """Return the printed averages, 4 rows: `configuration`, `direction`, the parameter, `half_digit`, `source`.

    Parameters
    ----------
    parameter:
        ``"k_kN_per_mm"`` for the last row of Table 9 (kN/mm), ``"beta_mm"`` for that of Table 11 (mm). The loading
        averages hold 0 km/h only, the unloading averages all four speeds.
    """
    return _typed(_MEANS[parameter], parameter)


def model_and_tests() -> pd.DataFrame:
    """Return Table 10, 20 rows: k (kN/mm) by `configuration`, `direction`, `speed_km_h` and `kind` (model, tests)."""
    return _typed("table_10_model_and_tests", STIFFNESS)


def load_deflection_plan() -> pd.DataFrame:
    """Return Table 6, 8 rows: `speed_km_h`, `direction`, `first_load_kN`, `last_load_kN`, `increment_kN` (signed)."""
    table = as_printed("table_06_load_deflection_tests").drop(columns="source")
    numbers = [column for column in table if column != "direction"]
    return table.astype(dict.fromkeys(numbers, float))


def tests_stiffness(configuration: str, direction: str, speed_km_h: float) -> float:
    """Return k (kN/mm) of the slow load-deflection tests, as Table 10 prints it.

    Raises
    ------
    KeyError
        If Table 10 has no such row (it has loading at 0 km/h only).
    """
    table = model_and_tests().query("kind == 'tests'").set_index(["configuration", "direction", "speed_km_h"])
    return table[STIFFNESS].to_dict()[configuration, direction, float(speed_km_h)]


def repeat_displacement() -> pd.DataFrame:
    """Return Table 8, 12 rows: `displacement_mm` of three repeats of four cases, with `half_digit` (mm)."""
    return _typed("table_08_repeat_displacement", "displacement_mm")


def printed_numbers() -> dict[str, Printed]:
    """Return the numbers printed outside the tables, as text, by quantity (`text_and_appendices.csv`)."""
    rows = as_printed("text_and_appendices")[["quantity", *Printed._fields]]
    return {quantity: Printed(*texts) for quantity, *texts in rows.itertuples(index=False)}


def errata() -> pd.DataFrame:
    """Return the errata of the source, as text: `item`, `printed`, `recomputed` (the corrected value), `note`."""
    return as_printed("errata")


def raw_sample(mended: bool = True) -> pd.DataFrame:
    """Return the 27 printed rows of a raw recording, named and in units as in the file's header.

    Parameters
    ----------
    mended:
        Whether to restore the minus signs that seven accelerations lost in print (False: as printed).

    Returns
    -------
    `X_Value` (s; it jumps, for the rows are excerpts), three voltages (V), `Acc m/s^2`, `Disp mm`, `Load kN`,
    `Time Elapsed` (NaN but for the first row). Source: appendix B1.
    """
    segment = read_lvm(data_path("sample/appendix_b1.lvm")).segments[0]
    channels = {channel.name: pd.Series(channel.values) for channel in segment}
    sample = pd.DataFrame({"X_Value": segment[0].time_s, **channels})
    if mended:
        volts, acceleration = sample["Raw Acc Voltage"].to_numpy(), sample["Acc m/s^2"].to_numpy()
        sample["Acc m/s^2"] = mend_signs(volts, acceleration)
    return sample
