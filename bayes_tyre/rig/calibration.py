"""Straight lines from volts to engineering units, the step of the digitiser, and restored minus signs."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Line(NamedTuple):
    """A straight line, value = slope * volts + intercept.

    Attributes
    ----------
    slope:
        Unit of the value a volt (m/s^2/V, mm/V or kN/V).
    intercept:
        Unit of the value (m/s^2, mm or kN).
    """

    slope: float
    intercept: float

    def __call__(self, volts: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Return the values on the line at these volts, of the same shape."""
        return self.slope * volts + self.intercept


def fit_line(volts: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> Line:
    """Return the least-squares line through (volts, values).

    Parameters
    ----------
    volts:
        V, shape (n,), at least two of them unlike.
    values:
        Engineering unit (m/s^2, mm or kN), shape (n,).

    Raises
    ------
    ValueError
        If fewer than two volts are unlike.

    Examples
    --------
    >>> fit_line(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    Line(slope=2.0, intercept=1.0)
    """
    if len(np.unique(volts)) < 2:
        raise ValueError("a line needs at least two unlike voltages")
    # About the means: volts vary in their fourth digit, so that the plain normal equations would lose six more.
    centre, level = volts.mean(), values.mean()
    slope = float((volts - centre) @ (values - level) / ((volts - centre) @ (volts - centre)))
    return Line(slope, float(level - slope * centre))


def quantisation_step(readings: Float[np.ndarray, " n"]) -> float:
    """Return the step between neighbouring levels of a digitised column, in the column's unit.

    The smallest gap between levels says how many steps each gap holds; the range over the sum of these is the step,
    which averages out the rounding of the printed digits.

    Parameters
    ----------
    readings:
        Voltages (V) or converted values (any unit), shape (n,), with at least two unlike.

    Raises
    ------
    ValueError
        If all readings are alike.
    """
    levels = np.unique(readings)
    if len(levels) < 2:
        raise ValueError("a step needs at least two unlike readings")
    gaps = np.diff(levels)
    return float((levels[-1] - levels[0]) / np.rint(gaps / gaps.min()).sum())


def mend_signs(volts: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the values with lost minus signs put back, for a sensor whose reading rises with its voltage.

    On a rising line every value below some voltage is negative. Each place for that voltage is tried, and the one
    whose signed values lie best on a line is taken. Magnitudes stay as they are.

    Parameters
    ----------
    volts:
        V, shape (n,), at least three of them unlike.
    values:
        Engineering unit, shape (n,); their signs are not trusted.

    Returns
    -------
    Signed values, shape (n,), in the order given. Used for the sample of appendix B1.

    Raises
    ------
    ValueError
        If fewer than three volts are unlike: any signs would fit a line through two.
    """
    if len(np.unique(volts)) < 3:
        raise ValueError("signs can be told only from three or more unlike voltages")
    order = np.argsort(volts, kind="stable")
    x, size = volts[order] - volts.mean(), np.abs(values[order])
    # A place between two unlike voltages, or before the first, or after the last: so many values below it.
    places = np.concatenate([[0], np.flatnonzero(np.diff(x) > 0) + 1, [len(x)]])
    # Sums of the signed values and of their products with x, for every place at once: a value that turns counts twice.
    total = size.sum() - 2 * np.append(0.0, np.cumsum(size))[places]
    product = x @ size - 2 * np.append(0.0, np.cumsum(x * size))[places]
    # Squares about the mean less what the line takes; their sum about zero is the same whatever the signs.
    misfit = -(total**2) / len(x) - product**2 / (x @ x)
    misfit[product <= 0] = np.inf
    if not np.isfinite(misfit).any():
        return values
    signed = np.empty_like(values)
    signed[order] = np.where(np.arange(len(x)) < places[np.argmin(misfit)], -size, size)
    return signed


def with_best_signs(volts: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the values as they stand, or `mend_signs` of them where these lie closer to a line."""
    mended = mend_signs(volts, values)
    return min((values, mended), key=lambda signed: residual_rms(fit_line(volts, signed), volts, signed))


def residual_rms(line: Line, volts: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> float:
    """Return the root mean square of what a line leaves of the values, in their unit."""
    return float(np.sqrt(np.mean((values - line(volts)) ** 2)))
