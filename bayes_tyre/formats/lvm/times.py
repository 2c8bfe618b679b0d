"""X of the samples of an `.lvm` table: from an X column, from X0 and Delta_X, or from both."""

import math

import numpy as np

from bayes_tyre.formats.lvm.channel_header import ChannelHeader

type SampleRows = slice | np.ndarray
#: Relative error of a spacing that matters to nothing.
_NEGLIGIBLE = 1e-5


def even_x(x: np.ndarray, header: ChannelHeader, x_digit: float) -> tuple[np.ndarray | None, float | None]:
    """Return an X column at the steps of Delta_X, None if it is blank; and Delta_X if the two contradict each other.

    They agree where most steps of X are Delta_X but for rounding, and so is their mean, to which the rounding of each X
    counts only at the ends; unless X was made by adding up a rounded step, which shows in steps that are all the same.
    Where Delta_X has more digits, samples then lie at its multiples from the first, and again from each that comes
    later than that, as after a pause. Else X is returned as it is.

    Parameters
    ----------
    x:
        Shape (rows,), s; NaN where a cell is blank.
    header:
        Of the channel that X belongs to.
    x_digit:
        Value of the last printed digit of X, s; NaN where it is unknown.
    """
    if np.isnan(x).all():
        return None, None
    with np.errstate(all="ignore"):  # a damaged file may hold infinite times
        steps = np.diff(x)
    there = np.isfinite(steps)
    if math.isnan(header.delta + x_digit) or not there.any():
        return x, None
    rounding = x_digit + header.delta_digit + _NEGLIGIBLE * header.delta + np.spacing(np.abs(x[np.isfinite(x)]).max())
    agree = there & (np.abs(steps - header.delta) <= rounding)
    if 2 * agree.sum() < there.sum():
        return x, header.delta
    runs, alike = 1 + np.sum(there & ~agree), np.ptp(steps[agree]) < x_digit / 2
    of_mean = header.delta_digit / 2 + x_digit * (runs / agree.sum() + alike / 2) + _NEGLIGIBLE * header.delta
    if abs(steps[agree].mean() - header.delta) > of_mean:
        return x, header.delta
    if header.delta_digit >= x_digit:
        return x, None
    row = np.arange(len(x))
    first = np.maximum.accumulate(np.where(np.append(True, ~agree), row, 0))
    even = x[first] + (row - first) * header.delta
    return (x if np.allclose(even, x, rtol=0, atol=1e-6 * header.delta, equal_nan=True) else even), None


def times_of(
    rows: SampleRows, x: np.ndarray | None, header: ChannelHeader, reference: ChannelHeader, written: int | None
) -> tuple[np.ndarray, str]:
    """Return X of a channel's samples, and a warning on it, which may be empty."""
    if x is None:
        if math.isnan(header.delta):
            return _index(rows).astype(float), "no X and no Delta_X: its time counts samples, not seconds"
        return _counted(rows, header), ""
    delay = header.x0 - reference.x0
    delay = 0.0 if math.isnan(delay) else delay
    rates = (header.delta, reference.delta)
    if not any(map(math.isnan, rates)) and not math.isclose(*rates, rel_tol=1e-6):
        if written and len(x) > written:
            index = _index(rows)
            return x[index - index % written] + delay + (index % written) * header.delta, ""
        return _counted(rows, header), ""
    times = x[rows] + delay if delay else x[rows]
    blank = np.isnan(times)
    if not blank.any():
        return times, ""
    if math.isnan(header.delta):
        return times, f"X is blank in {int(blank.sum())} rows, and there is no Delta_X"
    return np.where(blank, _counted(rows, header), times), f"X is blank in {int(blank.sum())} rows: taken from Delta_X"


def _index(rows: SampleRows) -> np.ndarray:
    return np.arange(rows.stop) if isinstance(rows, slice) else rows


def _counted(rows: SampleRows, header: ChannelHeader) -> np.ndarray:
    return (0.0 if math.isnan(header.x0) else header.x0) + _index(rows) * header.delta
