"""Slow load-deflection tests of known truth, in numpy alone: nothing in them was measured."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

SINGLE = {"load": 875 / 1300, "measured": 1300 / 950, "axle_kN": 2.518, "factor": 1.168441, "h": 619.85583}
DUAL = {"load": 875 / 1290, "measured": 1290 / 885, "axle_kN": 2.718, "factor": 1.167425, "h": 621.745577}


@dataclass(frozen=True)
class Tyre:
    """The law's parameters as on flat ground: kN/mm, kN, kN, mm."""

    k: float = 1.5
    C: float = 0.3
    x: float = 0.7
    beta: float = 0.05

    @property
    def settled(self) -> float:
        return self.x - self.k * self.beta

    def force(self, d: np.ndarray) -> np.ndarray:
        """Return the force, kN, along a path, mm, that begins on the settled loading branch."""
        F = [self.k * d[0] + self.C + self.settled]
        for before, after in pairwise(d):
            s = np.sign(after - before)
            left = F[-1] - (self.k * before + self.C) - s * self.settled
            F.append(self.k * after + self.C + s * self.settled + left * np.exp(-abs(after - before) / self.beta))
        return np.array(F)


def path(low_mm: float = 1.7, high_mm: float = 20.0, steps: int = 8) -> np.ndarray:
    """Return displacements up and down in even steps, mm; the highest stands once."""
    up = np.linspace(low_mm, high_mm, steps + 1)
    return np.concatenate([up, up[-2::-1]])


def on_flat_ground(
    tyre: Tyre, noise_kN: float = 0.0, seed: int = 0, d: np.ndarray | None = None, **factor_table
) -> pd.DataFrame:
    """Return a test whose readings are the tyre's own, as on flat ground (`--rig none`), noise on the force."""
    d = path() if d is None else d
    F = tyre.force(d) + noise_kN * np.random.default_rng(seed).normal(size=len(d))
    return pd.DataFrame({"test": "one", "load_kN": F, "displacement_mm": d, **factor_table, "origin": "simulated"})


def from_the_rig(table: pd.DataFrame, rig: dict[str, float]) -> pd.DataFrame:
    """Return a test as the rig reads it: cylinder load (kN) and displacement at the measurement point (mm)."""
    wheel_centre = table["displacement_mm"].to_numpy()
    flat = wheel_centre.copy()
    for _ in range(60):  # d_f = d_wc sin(theta), Eq. 7 and 10, for the d_wc that returns d_f
        u = rig["h"] - wheel_centre
        wheel_centre = flat / (u / np.hypot(u, 253.0))
    u = rig["h"] - wheel_centre
    force = table["load_kN"] * rig["factor"] * (u / np.hypot(u, 253.0))
    load = (force - rig["axle_kN"]) / rig["load"]
    return table.assign(load_kN=load, displacement_mm=wheel_centre / rig["measured"])


def campaign(noise_kN: float = 0.05, repeats: int = 3) -> pd.DataFrame:
    """Return tests of both configurations at 0 and 25 km/h as the rig reads them, three repeats each."""
    tests = []
    for configuration, rig, k in (("single", SINGLE, 1.5), ("dual", DUAL, 1.9)):
        for speed, low in ((0.0, 1.2), (25.0, 3.5)):
            for repeat in range(1, repeats + 1):
                seed = len(tests)
                factor_table = {"configuration": configuration, "speed_km_h": speed, "repeat": repeat}
                test = on_flat_ground(Tyre(k=k), noise_kN, seed, path(low, 26.0 / k), **factor_table)
                tests.append(from_the_rig(test, rig).assign(test=f"{configuration} ({speed:g}) slow {repeat}"))
    return pd.concat(tests, ignore_index=True)
