"""The design of the audit: a typical truth, each factor varied alone, and two or three of them crossed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

from bayes_tyre.record import Case
from bayes_tyre.rig.axle import Rig
from bayes_tyre.simulate.draw import critical_damping, draw_truth, stream
from bayes_tyre.simulate.plan import RATE_HZ, Planned
from bayes_tyre.simulate.truth import Truth

#: The rig, stationary: rolling records differ by their runout and not by their processing.
CONFIGURATION, INITIAL_LOAD_KN = "single", 20.0
# As in the quick plan: 2 s of rest before the step and after it, which the source takes its means over.
_DURATION_S, _STEP_BETWEEN_S = 4.5, (2.1, 2.3)


class Tyre(NamedTuple):
    """The truth of a record: the tyre's k, x and beta, the axle's damping, the load's rise time and step."""

    k_kN_per_mm: float = 1.8
    x_kN: float = 0.45
    beta_mm: float = 0.08
    damping_ratio: float = 0.03
    rise_s: float = 0.036
    step_kN: float = -10.0


#: After the simulator's draws: beta 0.045 to 0.13 mm, x 0.3 to 0.6 kN, damping 2 to 4 % of critical, unloading in 36
#: ms. The source processed the step from 20 to 10 kN at every speed.
TYPICAL = Tyre()
#: The factors, a column each; the last is a setting of the method `thesis`, in samples.
WINDOW = "window_samples"
FACTORS = (*Tyre._fields, WINDOW)
#: The source's moving average at its 10 kHz.
SOURCE_WINDOW = 801
#: The level of each factor that the others are varied about.
TYPICAL_LEVELS = {**TYPICAL._asdict(), WINDOW: SOURCE_WINDOW}
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
    """Levels of the factors.

    Attributes
    ----------
    alone:
        Levels of each factor that is varied alone, the others typical.
    crossed:
        Levels of the factors that are crossed with each other, the others typical.
    windows:
        Windows of the moving mean of `thesis`, samples at 10 kHz, the source's among them; crossed records use all.
    """

    alone: Mapping[str, tuple[float, ...]]
    crossed: Mapping[str, tuple[float, ...]]
    windows: tuple[int, ...]

    def tyres(self) -> list[Tyre]:
        """Return every truth once, the crossed ones first."""
        return list(dict.fromkeys([*self._crossed(), *self._alone()]))

    def windows_of(self, tyre: Tyre) -> tuple[int, ...]:
        """Return the windows that are used on a truth's records."""
        return self.windows if tyre in self._crossed() else (SOURCE_WINDOW,)

    def _crossed(self) -> list[Tyre]:
        every = product(*self.crossed.values())
        return [TYPICAL._replace(**dict(zip(self.crossed, levels, strict=True))) for levels in every]

    def _alone(self) -> list[Tyre]:
        varied = [(name, level) for name, levels in self.alone.items() for level in levels]
        return [TYPICAL, *(TYPICAL._replace(**{name: level}) for name, level in varied)]


_STEPS_KN = (-10.0, -5.0, 5.0, 10.0)
#: Every truth has x >= 1.5 k beta: the law needs x > k beta.
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

    The axle's mass, loads, friction at rest and start of the step belong to the replicate: they are the same at every
    point with one step, so that points differ by their factors alone. The noise is the record's own.
    """
    case = Case(CONFIGURATION, "loading" if tyre.step_kN > 0 else "unloading", 0.0, INITIAL_LOAD_KN, tyre.step_kN)
    planned = Planned(case, replicate, _DURATION_S, RATE_HZ, _STEP_BETWEEN_S)
    of_axle = int(stream(seed, "audit", str(replicate)).integers(2**32))
    of_noise = int(stream(seed, "audit", str(replicate), str(tuple(tyre))).integers(2**32))
    drawn = draw_truth(planned, rig, of_axle)
    k, x, beta = tyre.k_kN_per_mm, tyre.x_kN, tyre.beta_mm
    rests = drawn.rest_friction_kN / (drawn.x_kN - drawn.k_kN_per_mm * drawn.beta_mm)
    return replace(
        drawn,
        seed=of_noise,
        k_kN_per_mm=k,
        x_kN=x,
        beta_mm=beta,
        rise_time_s=tyre.rise_s,
        rest_friction_kN=rests * (x - k * beta),
        c_kN_s_per_mm=tyre.damping_ratio * critical_damping(rig, k, drawn.m_kg),
    )
