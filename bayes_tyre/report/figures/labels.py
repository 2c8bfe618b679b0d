"""What figures say: labels from files as plain text, and the names of parameters, intervals and origins."""

from collections.abc import Iterable
from functools import lru_cache

from matplotlib import font_manager

from bayes_tyre.record import ORIGIN_UNKNOWN

#: What each parameter is called on an axis, its unit where the table gives none, and its column when printed.
PARAMETERS = {
    "k": ("stiffness k", "kN/mm", "k_kN_per_mm"),
    "x": ("friction x", "kN", "x_kN"),
    "settled": ("friction, settled", "kN", "settled_kN"),
    "n": ("exponent n", "1", "n"),
    "belt_frequency": ("the belt's frequency", "Hz", "belt_frequency_Hz"),
    "belt_damping": ("the belt's damping ratio", "1", "belt_damping"),
    "sidewall_ratio": ("sidewall over residual stiffness", "1", "sidewall_ratio"),
    "beta": ("characteristic deflection beta", "mm", "beta_mm"),
    "m": ("mass m", "kg", "m_kg"),
    "c": ("damping c", "kN s/mm", "c_kN_s_per_mm"),
    "energy_per_cycle": ("energy lost a cycle", "J", "energy_per_cycle_J"),
}
#: Those that the printed tables have too; and those that range over factors, so that an axis may be logarithmic.
USUAL, WIDE = ("k", "beta"), ("beta", "x", "settled", "c", "energy_per_cycle")
_CALLED = {"energy_per_cycle": "energy a cycle"}
_ORIGINS = {
    "published": "published tables",
    "reconstructed": "reconstructed, not measured",
    "simulated": "simulated, not measured",
}


def called(parameter: str) -> str:
    """Return a parameter's name in running text, where a table's column would break the line."""
    return _CALLED.get(parameter, parameter)


def panels(found: Iterable[str]) -> list[str]:
    """Return the parameters that have a panel of their own: those found, in their order; where none is, `USUAL`."""
    has = set(found) & PARAMETERS.keys() or USUAL
    return [parameter for parameter in PARAMETERS if parameter in has]


@lru_cache(maxsize=1)
def _glyphs() -> frozenset[int]:
    return frozenset(font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap())


def plain(label: object, most: int = 40) -> str:
    """Return a label as text that is drawn as it stands: no mathtext, one line, no missing glyph, not too long."""
    text = " ".join(str(label).split())
    if len(text) > most:
        text = f"{text[: most - 10]}…{text[-9:]}"
    shown = "".join(c if ord(c) in _glyphs() else c.encode("unicode_escape").decode() for c in text)
    return shown.replace("$", r"\$")


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
