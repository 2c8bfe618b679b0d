"""What is recorded: the test plan of the source, and a quick one."""

from typing import NamedTuple

from bayes_tyre.record import Case

RATE_HZ = 10_000.0
REPEATS = (1, 2, 3)
CONFIGURATIONS = ("single", "dual")
SPEEDS_KM_H = (0.0, 15.0, 25.0, 35.0)
INITIAL_LOADS_KN = (10.0, 20.0, 30.0)


class Planned(NamedTuple):
    """One record to simulate.

    Attributes
    ----------
    case, repeat:
        What is tested, and which time.
    duration_s, rate_Hz:
        Length of the recording, s, and its sampling rate, Hz.
    step_between_s:
        The load's step begins between these times, s.
    """

    case: Case
    repeat: int
    duration_s: float
    rate_Hz: float
    step_between_s: tuple[float, float]

    @property
    def file(self) -> str:
        """The file's name by the source's pattern, such as ``DynamicS(0)30-20(1).lvm``."""
        return f"Dynamic{self.record}.lvm"

    @property
    def record(self) -> str:
        """The record's name, as `process` takes it from the file's: ``S(0)30-20(1)``."""
        return self.case.record(self.repeat)

    @property
    def label(self) -> str:
        """Case and repeat, such as ``single (0)30-20(1)``: what the record's random numbers hang on."""
        return f"{self.case.label}({self.repeat})"


def thesis_plan(rate_Hz: float = RATE_HZ) -> list[Planned]:
    """Return the source's step-load tests, 2 x 4 x 3 x 2 x 2 x 3 = 288 records of 15 s. Source: section 2.4.2, Table 7.

    From 10 kN the cylinder could not go down by 10 kN: it went down by 7.
    """
    records = []
    for configuration in CONFIGURATIONS:
        for speed in SPEEDS_KM_H:
            for load in INITIAL_LOADS_KN:
                for step in (5.0, 10.0, -5.0, -7.0 if load == 10 else -10.0):
                    case = _case(configuration, speed, load, step)
                    # The source's example begins its step at 4.51 s.
                    records += [Planned(case, repeat, 15.0, rate_Hz, (4.0, 5.5)) for repeat in REPEATS]
    return records


def quick_plan(rate_Hz: float = RATE_HZ) -> list[Planned]:
    """Return 24 stationary records of 4.5 s: both configurations, 20 and 30 kN, 10 kN up and down, three repeats.

    The step is in the middle, with the 2 s before it and after it that the source takes its means over.
    """
    cases = [
        _case(configuration, 0.0, load, step)
        for configuration in CONFIGURATIONS
        for load in (20.0, 30.0)
        for step in (10.0, -10.0)
    ]
    return [Planned(case, repeat, 4.5, rate_Hz, (2.1, 2.3)) for case in cases for repeat in REPEATS]


PLANS = {"thesis": thesis_plan, "quick": quick_plan}


def _case(configuration: str, speed: float, load: float, step: float) -> Case:
    return Case(configuration, "loading" if step > 0 else "unloading", speed, load, step)
