"""Records of Equation 2 in numpy alone, good ones and such as no fit can use, as one table."""

import numpy as np
import pandas as pd

from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.record_table import check_record_table

K, BETA, J, D_I, F_I = 1.6, 0.1, 0.4, 10.0, 14.0
NOISE_KN = 0.03


def record(
    points: int = 30,
    k: float = K,
    beta: float = BETA,
    J: float = J,
    travel: float = 3.0,
    noise_kN: float = NOISE_KN,
    seed: int = 3,
) -> pd.DataFrame:
    """A record of Equation 2 with noise on every point but the first, which d_i and F_i are taken from."""
    u = travel * (1 - np.cos(np.pi * np.linspace(0, 1, points))) / 2
    force = F_I + (np.sign(travel) * J + k * u) * -np.expm1(-np.abs(u) / beta)
    noise = np.random.default_rng(seed).normal(0.0, noise_kN, points) * (np.arange(points) > 0)
    return pd.DataFrame({"displacement_mm": D_I + u, "force_kN": force + noise})


def flattened(points: int = 30) -> pd.DataFrame:
    return record(points).assign(displacement_mm=D_I)


def with_force(row: int, force_kN: float) -> pd.DataFrame:
    spoilt = record()
    spoilt.loc[row, "force_kN"] = force_kN
    return spoilt


#: Of at most 32 points, so that all are of one batch and one compilation.
RECORDS = {
    "loading": record(),
    "unloading": record(travel=-3.0),
    "another": record(23, seed=4),
    "short": record(8, beta=0.8, noise_kN=0.003),
    "exact": record(31, noise_kN=0.0),
    "full": record(32),
    "five": record(5, beta=0.8, noise_kN=0.0),
    "one point": record(1),
    "three points": record(3),
    "no travel": flattened(),
    "falling loading": record(k=-K, J=-J),
    "falling unloading": record(k=-K, J=-J, travel=-3.0),
    # By chance the noise closes the profile of a beta far off in 1 record of 40: not in these.
    "tiny beta": record(beta=1e-6, seed=5),
    "tiny beta exact": record(beta=1e-6, noise_kN=0.0),
    "huge beta": record(k=1600.0, beta=1e3),
    "huge beta unloading": record(k=1600.0, beta=1e3, travel=-3.0),
    "two points": record(2),
    "there and back": pd.concat([record(16), record(16).iloc[::-1]]),
    "absurd force": with_force(12, 1e300),
    "absurd last force": with_force(29, -1e300),
    "absurd displacement": record() * [1e300, 1.0],
    "absurd both": record() * 1e300,
    "vanishing": record() * 1e-300,
    "vanishing travel": record() * [1e-150, 1.0],
    "constant force": record().assign(force_kN=F_I),
    "nothing but noise": record(k=0.0, J=0.0),
    "absurd and ends meet": record().assign(force_kN=1.7e308 * (-1.0) ** np.arange(30)),
}
LONG = {"longest": record(60, noise_kN=0.0)}


def table_of(records: dict[str, pd.DataFrame]) -> pd.DataFrame:
    return check_record_table(pd.concat([points.assign(record=name) for name, points in records.items()]))


def fitted(records: dict[str, pd.DataFrame], settings: FitSettings | None = None) -> pd.DataFrame:
    """Return the fits, to be looked up by record."""
    return by_record(fit_records(table_of(records), settings))


def by_record(fits: pd.DataFrame) -> pd.DataFrame:
    return fits.set_index("record", drop=False)


#: beta and d_i fixed, F_i freed.
FIXED = FitSettings(fix={"beta": BETA, "d_i": D_I}, free=("F_i",))
