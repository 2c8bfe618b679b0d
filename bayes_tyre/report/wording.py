"""What parameters are called wherever they are shown, and text from files made safe for one line."""

from collections.abc import Iterable

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
#: The most of a label that is shown.
LONGEST = 30


def called(parameter: str) -> str:
    """Return a parameter's name in running text, where a table's column would break the line."""
    return _CALLED.get(parameter, parameter)


def panels(found: Iterable[str]) -> list[str]:
    """Return the parameters that have a panel of their own: those found, in their order; where none is, `USUAL`."""
    has = set(found) & PARAMETERS.keys() or USUAL
    return [parameter for parameter in PARAMETERS if parameter in has]


def shown(text: object, most: int | None = LONGEST) -> str:
    """Return a text from a file or a path in one line, what would steer a terminal replaced, not too long."""
    line = str(text) if most is None else " ".join(str(text).split())
    line = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)
    return line if most is None or len(line) <= most else f"{line[: most - 1]}\N{HORIZONTAL ELLIPSIS}"
