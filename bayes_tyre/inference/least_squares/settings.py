"""Settings of a least-squares fit of records: region, free and fixed parameters, starts, bounds; checked."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.parameters import PARAMETERS

REGIONS = ("all", "thesis")


@dataclass(frozen=True)
class FitSettings:
    """Region, free and fixed parameters, starts and bounds.

    Attributes
    ----------
    region:
        ``all`` points with starts estimated from the data, or ``thesis``: the source's first 70 % and its starts.
    fix, start:
        Values by parameter name (`k` kN/mm, `C` kN, `beta` mm, `d_i` mm, `F_i` kN).
    free:
        Parameters to fit beside k, C and beta; d_i and F_i are the record's first point unless freed.
    bounds:
        Low and high bound by parameter name, in the same units; infinite where there is none.

    Raises
    ------
    BadInput
        For unknown names, values that are not finite, a beta that is not positive, a parameter both fixed
        and freed, started or bounded, one started or bounded that is not fitted, bounds that leave no room
        or leave a start outside, and nothing left to fit.
    """

    region: str = "all"
    fix: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.region not in REGIONS:
            raise BadInput(f"region {self.region!r} is unknown; use {' or '.join(REGIONS)}")
        for name in (*self.fix, *self.free, *self.start, *self.bounds):
            if name not in PARAMETERS:
                raise BadInput(f"parameter {name!r} is unknown; use one of {', '.join(PARAMETERS)}")
        for name, value in (*self.fix.items(), *self.start.items()):
            if not math.isfinite(value) or (name == "beta" and value <= 0):
                raise BadInput(f"{name}={value}: give a finite number{', above 0' if name == 'beta' else ''}")
        for name in self.fix:
            if name in self.free or name in self.start:
                raise BadInput(f"{name} is fixed and also freed or started; choose one")
            if name in self.bounds:
                raise BadInput(f"{name} is fixed and also bounded; choose one")
        for name, what in (*((name, "a start") for name in self.start), *((name, "bounds") for name in self.bounds)):
            if PARAMETERS.index(name) not in self.free_indices:
                raise BadInput(f"{name} has {what} but is not fitted; add --free {name}")
        for name, (low, high) in self.bounds.items():
            self._check_bounds(name, low, high)
        if not self.free_indices:
            raise BadInput("every parameter is fixed; leave at least one to fit")

    def _check_bounds(self, name: str, low: float, high: float) -> None:
        given = f"{name}={'' if low == -math.inf else f'{low:g}'}:{'' if high == math.inf else f'{high:g}'}"
        if (low, high) == (-math.inf, math.inf):
            raise BadInput(f"{given} bounds neither side; give LOW, HIGH or both")
        if not low < high:
            raise BadInput(f"{given} leaves no room; give a LOW that is less than HIGH")
        if name == "beta" and high <= 0:
            raise BadInput(f"{given} excludes every beta, which is above 0; give a HIGH above 0")
        if not low <= self.start.get(name, low) <= high:
            raise BadInput(f"{given} excludes the start {self.start[name]:g}; give one inside")

    @property
    def free_indices(self) -> tuple[int, ...]:
        """Indices into `PARAMETERS` of the fitted parameters."""
        free = {"k", "C", "beta", *self.free} - set(self.fix)
        return tuple(i for i, name in enumerate(PARAMETERS) if name in free)
