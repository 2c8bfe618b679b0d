"""Names of parameters, and probabilities, as tables and figures state them."""

import math
from collections.abc import Iterable

#: Names on an axis by parameter, in the order of panels.
AXIS_NAMES = {
    "k": "stiffness k",
    "x": "friction x",
    "settled": "friction, settled",
    "n": "exponent n",
    "belt_frequency": "the belt's frequency",
    "belt_damping": "the belt's damping ratio",
    "sidewall_ratio": "sidewall over residual stiffness",
    "beta": "characteristic deflection beta",
    "m": "mass m",
    "c": "damping c",
    "energy_per_cycle": "energy lost a cycle",
}
#: Parameters of the printed tables; and parameters that may range over decades, so that an axis may be logarithmic.
USUAL, WIDE = ("k", "beta"), ("beta", "x", "settled", "c", "energy_per_cycle")
#: Smallest distance of a probability from 0 or 1 that text states: no posterior is known better.
_NEAREST = 1e-4
_NAME_IN_TEXT = {"energy_per_cycle": "energy a cycle"}


def text_name(parameter: str) -> str:
    """Return a parameter's name in a sentence, which differs from its column where that would not read."""
    return _NAME_IN_TEXT.get(parameter, parameter)


def probability_text(p: float, decimals: int = 3) -> str:
    """Return a probability as text; one that would round to 0 or 1 as a bound, ``>= 0.9998``; empty for none.

    No finite number of draws makes a ratio certain to be above 1, so the text is never 0 or 1: the bound has one digit
    of the distance to 0 or 1, rounded away from it, and that distance is at least `_NEAREST`.
    """
    if not math.isfinite(p):
        return ""
    text = f"{p:.{decimals}f}"
    if 0.0 < float(text) < 1.0:
        return text
    distance = max(min(p, 1.0 - p), _NEAREST)
    digits = -math.floor(math.log10(distance))
    distance = math.ceil(round(distance * 10**digits, 6)) / 10**digits
    return f">= {1.0 - distance:.{digits}f}" if p > 0.5 else f"<= {distance:.{digits}f}"


def panels(available: Iterable[str]) -> list[str]:
    """Return the available parameters that have a panel, in the order of `AXIS_NAMES`; `USUAL` where there is none."""
    names = set(available) & AXIS_NAMES.keys() or USUAL
    return [parameter for parameter in AXIS_NAMES if parameter in names]
