"""Labels on figures: text from files drawn as it stands, names of intervals, units and origins."""

from functools import lru_cache

from matplotlib import font_manager

from bayes_tyre.plain_text import escaped
from bayes_tyre.record import ORIGIN_UNKNOWN

_ORIGINS = {
    "published": "published tables",
    "reconstructed": "reconstructed, not measured",
    "simulated": "simulated, not measured",
}


@lru_cache(maxsize=1)
def _glyphs() -> frozenset[int]:
    return frozenset(font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap())


def plain(label: object, most: int = 40) -> str:
    """Return a label as text that is drawn as it stands: no mathtext, one line, no missing glyph, not too long."""
    text = " ".join(str(label).split())
    if len(text) > most:
        text = f"{text[: most - 10]}…{text[-9:]}"
    return escaped(text, lambda c: ord(c) in _glyphs()).replace("$", r"\$")


def configuration_label(name: str) -> str:
    """Return a configuration as a title or legend shows it."""
    return plain(name or "configuration not stated")


def interval_name(interval: float) -> str:
    """Return an interval's name, such as ``95 % interval``."""
    return f"{100 * interval:g} % interval"


def decimals(value: float) -> str:
    """Return a number with two decimals and a minus sign as axes have it; nothing that rounds to zero has a sign."""
    return f"{round(value, 2) + 0.0:.2f}".replace("-", "\u2212")


def unit_name(unit: str) -> str:
    """Return a unit as it stands in brackets on an axis; a pure number's too."""
    return plain(unit) if unit not in ("", "1") else "no unit"


def origin_note(origin: str) -> str:
    """Return the corner text for an origin as `bayes_tyre.record_table.origin_of` gives it."""
    parts = [part.strip() for part in origin.split(" + ") if part.strip()] or [ORIGIN_UNKNOWN]
    return "data: " + "; ".join(_ORIGINS.get(part, part) for part in parts)
