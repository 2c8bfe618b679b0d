"""Data sets of NIST's Statistical Reference Datasets, y = b1 (1 - exp(-b2 x)), and their certified values."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Certified:
    """Data and certified values of a set of NIST StRD."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    b1: float
    b1_sd: float
    b2: float
    b2_sd: float
    residual_sd: float
    starts: dict[str, tuple[float, float]]


SETS = {
    "Misra1a": Certified(
        x=(77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0),
        y=(10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78),
        b1=2.3894212918e02,
        b1_sd=2.7070075241e00,
        b2=5.5015643181e-04,
        b2_sd=7.2668688436e-06,
        residual_sd=1.0187876330e-01,
        starts={"NIST 1": (500.0, 1e-4), "NIST 2": (250.0, 5e-4)},
    ),
    "BoxBOD": Certified(
        x=(1.0, 2.0, 3.0, 5.0, 7.0, 10.0),
        y=(109.0, 149.0, 149.0, 191.0, 213.0, 224.0),
        b1=2.1380940889e02,
        b1_sd=1.2354515176e01,
        b2=5.4723748542e-01,
        b2_sd=1.0455993237e-01,
        residual_sd=1.7088072423e01,
        starts={"NIST 1": (1.0, 1.0), "NIST 2": (100.0, 0.75)},
    ),
}
