"""How each configuration looks: one colour, marker and line for it in every figure of a result."""

from collections.abc import Iterable
from itertools import count
from typing import Any, NamedTuple

from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.typing import LineStyleType

#: What is measured, printed or counted, and belongs to no configuration; and what stands behind it.
INK, PALE = "#222222", "#999999"
# Blue, vermillion, green, purple, sky and orange of Okabe and Ito (2008): apart for all kinds of colour vision.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_LINES: tuple[LineStyleType, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
#: Where most of what is drawn should lie; and the same behind points, where it must not hide them.
PALE_BAND: dict[str, Any] = {"facecolor": (PALE, 0.3), "edgecolor": "none", "linewidth": 0}
FAINT_BAND: dict[str, Any] = PALE_BAND | {"facecolor": (PALE, 0.25)}
#: What looks the same in every result: a report of single tyres beside one of dual pairs is read by their colours.
_OWN = {"dual": 0, "single": 1}
_HATCHES = ("", "////", "....", "xxxx", "----")
_MARKERS = ("o", "s", "^", "v", "P", "X", "p")


class Look(NamedTuple):
    """How one configuration is drawn wherever it appears; colour, marker and line each tell it from the next."""

    colour: str
    marker: str
    line: LineStyleType
    hatch: str

    @property
    def shade(self) -> dict[str, Any]:
        """How an area of it is filled."""
        tint, edge = (self.colour, 0.15), (self.colour, 0.6)
        return {"facecolor": tint, "edgecolor": edge, "hatch": self.hatch, "linewidth": 0}

    @property
    def band(self) -> dict[str, Any]:
        """How a band with points on it is filled: without a hatch."""
        return {"facecolor": (self.colour, 0.3), "edgecolor": "none", "linewidth": 0}

    @property
    def density_handle(self) -> tuple[Patch, Line2D]:
        """What stands for its densities in a legend."""
        return Patch(**self.shade), Line2D([], [], color=self.colour, linestyle=self.line, marker=self.marker)

    @property
    def interval_handle(self) -> Line2D:
        """What stands for its intervals in a legend."""
        return Line2D([], [], color=self.colour, linewidth=1.6, marker=self.marker)


def looks_of_none(labels: Iterable[str]) -> dict[str, Look]:
    """Return looks of what is no configuration, such as methods, in the order given: none is single's or dual's."""
    return {label: _look(place) for place, label in enumerate(dict.fromkeys(labels), start=len(_OWN))}


def _places(labels: Iterable[str]) -> dict[str, int]:
    """Return the place of each label: its own where it has one, and of the others the free ones in their order."""
    labels = list(labels)
    taken = {_OWN[label] for label in labels if label in _OWN}
    free = (i for i in count() if i not in taken)
    return {label: _OWN[label] if label in _OWN else next(free) for label in labels}


def _look(i: int) -> Look:
    return Look(
        _COLOURS[i % len(_COLOURS)], _MARKERS[i % len(_MARKERS)], _LINES[i % len(_LINES)], _HATCHES[i % len(_HATCHES)]
    )


class Setting(NamedTuple):
    """What all figures of one result share.

    Attributes
    ----------
    origin:
        Where the data come from, such as ``"reconstructed"``; it stands in the corner.
    verdict:
        ``pass`` or ``fail``; a fail is said in the other corner.
    configurations:
        All that the result has, so that each keeps its look in a figure that shows only some of them.
    """

    origin: str
    verdict: str = "pass"
    configurations: tuple[str, ...] = ()

    def looks(self, shown: Iterable[str]) -> dict[str, Look]:
        """Return the look of each configuration shown, in sorted order; a label the result has not comes after all.

        It is always the same for the same configurations; 210 of them differ.
        """
        wanted, configurations = set(shown), sorted(set(self.configurations))
        places = _places([*configurations, *sorted(wanted.difference(configurations))])
        return {label: _look(places[label]) for label in sorted(wanted)}


#: Of figures of studies, whatever they show.
SIMULATED = Setting("simulated")
