"""Numbers and labels as the document's reader sees them."""

import math

from bayes_tyre.plain_text import one_line

#: Significant digits in a table; the most letters of a label.
DIGITS, LONGEST = 4, 80
PERCENT = "\N{NO-BREAK SPACE}%"


def rounded(value: float) -> str:
    """Return a number with `DIGITS` significant digits, a real minus sign, and no exponent within reason."""
    if not math.isfinite(value):
        return ""
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{DIGITS - 1}e}"))))
    text = f"{value:.{max(0, DIGITS - 1 - power)}f}" if -6 < power < 7 else f"{value:.{DIGITS - 1}e}"
    return text.replace("-", "\N{MINUS SIGN}")


def given(value: float) -> str:
    """Return a number that somebody chose, such as a speed, without digits that it does not have."""
    return f"{value:g}".replace("-", "\N{MINUS SIGN}") if math.isfinite(value) else ""


def ratio_text(value: float) -> str:
    """Return a ratio for a sentence; what only rounds to 1 shows on which side of it it lies."""
    if f"{value:.2f}" == "1.00":
        return f"{value:.3f}"
    return f"{value:.2f}" if 0.1 <= value < 100 else rounded(value)


def percent_apart(ratio: float) -> str:
    """Return how far a ratio is from 1, such as ``31 %``."""
    apart = 100 * abs(ratio - 1)
    return f"{apart:.0f}{PERCENT}" if apart >= 9.95 else f"{apart:.1f}{PERCENT}"


def probability(p: float) -> str:
    """Return a probability for a sentence; what only rounds to 0 or 1 does not claim it."""
    return f"above 99{PERCENT}" if p > 0.995 else f"below 1{PERCENT}" if p < 0.005 else f"{100 * p:.0f}{PERCENT}"


def interval_name(interval: float) -> str:
    """Return an interval's name for a sentence, such as ``95 % interval``."""
    return f"{100 * interval:g}{PERCENT} interval"


def label(text: object, most: int = LONGEST) -> str:
    """Return a label from a file as one line of at most `most` characters (`wording.one_line`)."""
    return one_line(text, most)
