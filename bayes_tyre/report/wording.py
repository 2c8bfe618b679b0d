"""Names and units of parameters in tables and figures, and text from files made safe to print on one line."""

from collections.abc import Iterable

#: By parameter: its name on an axis, its unit where a table gives none, and its column in printed tables.
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
#: Parameters of the printed tables; and parameters that may range over decades, so that an axis may be logarithmic.
USUAL, WIDE = ("k", "beta"), ("beta", "x", "settled", "c", "energy_per_cycle")
_NAME_IN_TEXT = {"energy_per_cycle": "energy a cycle"}
#: Most characters of a label.
LONGEST = 30


def text_name(parameter: str) -> str:
    """Return a parameter's name in a sentence, which differs from its column where that would not read."""
    return _NAME_IN_TEXT.get(parameter, parameter)


def panels(available: Iterable[str]) -> list[str]:
    """Return the available parameters that have a panel, in the order of `PARAMETERS`; `USUAL` where there is none."""
    names = set(available) & PARAMETERS.keys() or USUAL
    return [parameter for parameter in PARAMETERS if parameter in names]


def one_line(text: object, most: int | None = LONGEST) -> str:
    """Return a text from a file as one line of at most `most` characters, each unprintable one replaced by U+FFFD.

    With `most` None, as for a path, nothing is shortened and spaces are left alone.
    """
    line = str(text) if most is None else " ".join(str(text).split())
    line = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)
    return line if most is None or len(line) <= most else f"{line[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
