"""What the audit simulates: a typical truth, one factor varied at a time, and a full grid where the story is."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

from bayes_tyre.record import Case
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2
from bayes_tyre.simulate.draw import draw_truth, stream
from bayes_tyre.simulate.plan import RATE_HZ, Planned
from bayes_tyre.simulate.truth import Truth

#: The rig; it stands still, for rolling records differ by their runout and not by their processing.
CONFIGURATION, INITIAL_LOAD_KN = "single", 20.0
# As the quick plan has it: 2 s of rest before the step and after it, which the source takes its means over.
_DURATION_S, _STEP_BETWEEN_S = 4.5, (2.1, 2.3)


class Tyre(NamedTuple):
    """What is true of a record: the tyre's k, x and beta, the axle's damping, the load's rise time and step."""

    k_kN_per_mm: float = 1.8
    x_kN: float = 0.45
    beta_mm: float = 0.08
    damping_ratio: float = 0.03
    rise_s: float = 0.036
    step_kN: float = -10.0


#: By what the simulator draws: beta 0.045 to 0.13 mm, x 0.3 to 0.6 kN, damping 2 to 4 % of critical, unloading in 36
#: ms. Down by 10 kN from 20 is a case that the source could process at every speed.
TYPICAL = Tyre()
#: The factors, a column each; the last is no truth but a choice of the method `thesis`, in samples.
WINDOW = "window_samples"
FACTORS = (*Tyre._fields, WINDOW)
#: The source's moving average at its 10 kHz.
SOURCE_WINDOW = 801
#: What each factor is called, and its unit.
FACTOR_NAMES = {
    "k_kN_per_mm": ("true k", "kN/mm"),
    "x_kN": ("true x", "kN"),
    "beta_mm": ("true beta", "mm"),
    "damping_ratio": ("damping ratio", "share of critical"),
    "rise_s": ("rise time", "s"),
    "step_kN": ("step", "kN"),
    WINDOW: ("window", "samples"),
}


@dataclass(frozen=True)
class Plan:
    """Factors of the factors.

    Attributes
    ----------
    alone:
        Factors of factors that are varied alone, the others typical.
    crossed:
        Factors of factors that are varied with each other, the others typical.
    windows:
        Of the moving mean of `thesis`, samples at 10 kHz, the source's among them; tried on every crossed record.
    """

    alone: Mapping[str, tuple[float, ...]]
    crossed: Mapping[str, tuple[float, ...]]
    windows: tuple[int, ...]

    def tyres(self) -> list[Tyre]:
        """Return every truth once, the crossed ones first."""
        return list(dict.fromkeys([*self._crossed(), *self._alone()]))

    def windows_of(self, tyre: Tyre) -> tuple[int, ...]:
        """Return the windows that are tried on a truth's records."""
        return self.windows if tyre in self._crossed() else (SOURCE_WINDOW,)

    def _crossed(self) -> list[Tyre]:
        every = product(*self.crossed.values())
        return [TYPICAL._replace(**dict(zip(self.crossed, factors, strict=True))) for factors in every]

    def _alone(self) -> list[Tyre]:
        varied = [(name, level) for name, factors in self.alone.items() for level in factors]
        return [TYPICAL, *(TYPICAL._replace(**{name: level}) for name, level in varied)]


_STEPS_KN = (-10.0, -5.0, 5.0, 10.0)
#: Every truth has x of 1.5 k beta at least, as the law needs and the simulator's own have.
PLANS = {
    "quick": Plan(
        {
            "k_kN_per_mm": (1.3, 1.8, 2.5),
            "x_kN": (0.25, 0.45, 0.7),
            "damping_ratio": (0.03, 0.1, 0.2),
            "rise_s": (0.02, 0.036, 0.06, 0.09),
            "step_kN": _STEPS_KN,
        },
        {"beta_mm": (0.02, 0.04, 0.08, 0.16), "rise_s": (0.036, 0.06, 0.09)},
        (1, 201, 401, SOURCE_WINDOW, 1601),
    ),
    "full": Plan(
        {
            "k_kN_per_mm": (1.3, 1.5, 1.8, 2.1, 2.5),
            "x_kN": (0.25, 0.35, 0.45, 0.6, 0.8),
            "damping_ratio": (0.01, 0.03, 0.06, 0.1, 0.2),
            "step_kN": _STEPS_KN,
        },
        {"beta_mm": (0.01, 0.02, 0.04, 0.06, 0.08, 0.12, 0.16), "rise_s": (0.02, 0.036, 0.05, 0.07, 0.09)},
        (1, 101, 201, 401, SOURCE_WINDOW, 1201, 1601),
    ),
}


def truth_of(tyre: Tyre, replicate: int, rig: Rig, seed: int) -> Truth:
    """Return the truth of a record; it depends on nothing but its point, its replicate, its rig and the seed.

    The axle's mass, its loads, where its friction rests and when its step begins belong to the replicate: they are the
    same at every point of one step, so that points differ by what they say. The noise is the record's own.
    """
    case = Case(CONFIGURATION, "loading" if tyre.step_kN > 0 else "unloading", 0.0, INITIAL_LOAD_KN, tyre.step_kN)
    planned = Planned(case, replicate, _DURATION_S, RATE_HZ, _STEP_BETWEEN_S)
    of_axle = int(stream(seed, "audit", str(replicate)).integers(2**32))
    of_noise = int(stream(seed, "audit", str(replicate), str(tuple(tyre))).integers(2**32))
    drawn = draw_truth(planned, rig, of_axle)
    k, x, beta = tyre.k_kN_per_mm, tyre.x_kN, tyre.beta_mm
    rests = drawn.rest_friction_kN / (drawn.x_kN - drawn.k_kN_per_mm * drawn.beta_mm)
    # As the simulator has it: the middle line's slope at the wheel centre, 10 mm down.
    at_wheel_centre = k * geometry.curvature_factor(rig) * float(geometry.sin_theta(rig, 10.0)) ** 2
    return replace(
        drawn,
        seed=of_noise,
        k_kN_per_mm=k,
        x_kN=x,
        beta_mm=beta,
        rise_time_s=tyre.rise_s,
        rest_friction_kN=rests * (x - k * beta),
        c_kN_s_per_mm=2 * tyre.damping_ratio * math.sqrt(at_wheel_centre * drawn.m_kg * KN_PER_KG_MM_PER_S2),
    )
