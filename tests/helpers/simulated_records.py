"""Records of known truth, drawn in numpy alone from the model that INFERENCE describes: noise on every point."""

from dataclasses import dataclass

import numpy as np
import pandas as pd


@dataclass(frozen=True)
class Plan:
    """What to simulate; scatter is relative, forces in kN, displacements in mm.

    `apart` is by how many times k of some cases is off.
    """

    configurations: tuple[str, ...] = ("single", "dual")
    speeds: tuple[float, ...] = (0.0, 25.0)
    loads: tuple[float, ...] = (20.0, 30.0)
    steps: tuple[float, ...] = (-10.0, 10.0)
    repeats: int = 3
    points: int = 60
    noise_kN: float = 0.03
    discordant: tuple[str, ...] = ()
    apart: tuple[tuple[str, float], ...] = ()


def simulate(plan: Plan, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return a record table and its truth, a row a record."""
    rng = np.random.default_rng(seed)
    tables, truths = [], []
    for configuration in plan.configurations:
        for speed in plan.speeds:
            for load in plan.loads:
                for step in plan.steps:
                    case = {
                        "configuration": configuration,
                        "direction": "loading" if step > 0 else "unloading",
                        "speed_km_h": speed,
                        "initial_load_kN": load,
                        "step_kN": step,
                    }
                    k_case = (1.6 if configuration == "single" else 2.2) * np.exp(rng.normal(0, 0.08))
                    k_case *= dict(plan.apart).get(f"{configuration} ({speed:g}){load:g}-{load + step:g}", 1.0)
                    beta_case = 0.05 * np.exp(rng.normal(0, 0.3))
                    scatter = 0.04 if speed == 0 else 0.10
                    for repeat in range(1, plan.repeats + 1):
                        name = f"{configuration} ({speed:g}){load:g}-{load + step:g}({repeat})"
                        widen = 6.0 if name in plan.discordant else 1.0
                        k = k_case * np.exp(widen * rng.normal(0, scatter))
                        beta = beta_case * np.exp(widen * rng.normal(0, 2 * scatter))
                        J = np.sign(step) * 0.4 * np.exp(rng.normal(0, 0.1))
                        d_i, F_i = load / 2.0, 0.7 * load
                        u = np.sign(step) * 3.0 * (1 - np.cos(np.pi * np.linspace(0, 1, plan.points))) / 2
                        force = F_i + (J + k * u) * (1 - np.exp(-np.abs(u) / beta))
                        force = force + rng.normal(0, plan.noise_kN, plan.points)
                        factor_table = {"record": name, **case, "repeat": repeat}
                        frame = pd.DataFrame({"displacement_mm": d_i + u, "force_kN": force})
                        tables.append(frame.assign(**factor_table, origin="simulated"))
                        truths.append(
                            {**factor_table, "k": k, "beta": beta, "J": J, "F_i": F_i, "sigma": plan.noise_kN}
                            | {"k_case": k_case, "beta_case": beta_case}
                        )
    return pd.concat(tables, ignore_index=True), pd.DataFrame(truths)
