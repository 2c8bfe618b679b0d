"""Records of known truth as a rig may deliver them: as the model has them, or with one fault. NumPy alone.

Nothing is shared with the likelihood of the fit. Cases differ by configuration x direction, speed, initial load and a
remainder, and repeats scatter about their case, by the standard deviations in `SD`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.record import Case

#: Standard deviations of the logarithm of k and beta, of each effect; and a typical k (kN/mm) by configuration.
SD = {
    "k": {"group": 0.10, "speed": 0.06, "load": 0.06, "remainder": 0.04, "repeat": 0.04},
    "beta": {"group": 0.20, "speed": 0.15, "load": 0.15, "remainder": 0.12, "repeat": 0.10},
}
TYPICAL_K = {"single": 1.6, "dual": 2.2}
#: Standard deviations of the logarithms between tyres of one type, where there are several.
SD_OF_TYRES = {"k": 0.06, "beta": 0.15}
#: Size of every step, kN; travel and displacement at the start, mm; offset of the envelope, kN, and its relative sd.
STEP_KN, TRAVEL_MM, START_MM, OFFSET_KN, SD_OFFSET = 10.0, 5.0, 10.0, 1.0, 0.1
#: The two configurations compared.
CONTRAST = "dual / single"
#: What `uneven_noise` calls near the start, mm.
NEAR_START_MM = 0.3


@dataclass(frozen=True)
class Kind:
    """One kind of data: a small factorial design, what is wrong with its records, and the options of its fit.

    Attributes
    ----------
    speeds_km_h, loads_kN, repeats, points:
        Levels of the design beside two configurations and two directions; records of a case; points of a record.
    beta_mm, sigma_kN:
        Typical beta, and the noise of the force.
    step_of_reading_mm, displacement_noise_mm:
        Readings of displacement are rounded to the one, and have noise of the other.
    rest_points:
        Further points of each record, at rest before its step.
    rho:
        Lag-1 autocorrelation of the noise of the force.
    noise_near_start:
        Factor on the noise within `NEAR_START_MM` of the start.
    noise_freedom:
        Degrees of freedom of Student's t that the noise of the force is, with scale `sigma_kN`; infinity: normal.
    small_step_limit:
        Whether records follow Equation 1's limit for small steps instead of Equation 2.
    hardening_per_mm:
        Relative growth of stiffness with deflection; the true k is then the mean over the travel.
    repeat_freedom:
        Degrees of freedom of Student's t by which repeats scatter about their case; infinity: normal.
    case_apart:
        Factor on k of the last case, which no effect of its factors explains.
    held_out_km_h:
        A speed whose records are not fitted, and whose cases are predicted; NaN: none.
    speed_trend:
        Whether effects of speed lie on a line instead of each by itself.
    tyres:
        How many of each configuration there are, which differ by `SD_OF_TYRES`: repeats take turns on them. The true
        values of a case are those of the average tyre.
    options:
        Of the model, as `bayes_tyre.inference.model.settings.ModelSettings` names them.
    """

    speeds_km_h: tuple[float, ...] = (0.0, 25.0)
    loads_kN: tuple[float, ...] = (20.0,)
    repeats: int = 3
    points: int = 40
    beta_mm: float = 0.1
    sigma_kN: float = 0.03
    step_of_reading_mm: float = 0.0
    displacement_noise_mm: float = 0.0
    rest_points: int = 0
    rho: float = 0.0
    noise_near_start: float = 1.0
    noise_freedom: float = np.inf
    small_step_limit: bool = False
    hardening_per_mm: float = 0.0
    repeat_freedom: float = np.inf
    case_apart: float = 1.0
    held_out_km_h: float = np.nan
    speed_trend: bool = False
    tyres: int = 1
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def settings(self) -> str:
        """The options of the fit in words."""
        return ", ".join(f"{name} {value}" for name, value in self.options.items()) or "default"


KINDS = {
    "clean": Kind(),
    "displacement_steps": Kind(points=120, beta_mm=0.03, step_of_reading_mm=0.0126),
    "displacement_noise": Kind(beta_mm=0.03, displacement_noise_mm=0.01),
    "displacement_noise_as_known": Kind(beta_mm=0.03, displacement_noise_mm=0.01, options={"displacement_sd": 0.01}),
    "displacement_noise_at_rest": Kind(
        points=400, rest_points=30, beta_mm=0.03, displacement_noise_mm=0.005, options={"displacement_sd": 0.005}
    ),
    "correlated_noise": Kind(rho=0.35),
    "correlated_noise_as_iid": Kind(rho=0.35, options={"noise": "iid"}),
    "heavy_tailed_noise": Kind(noise_freedom=3.0, options={"noise": "student"}),
    "heavy_tailed_noise_as_normal": Kind(noise_freedom=3.0),
    "clean_as_heavy_tailed": Kind(options={"noise": "student"}),
    "small_step_limit": Kind(small_step_limit=True),
    "small_step_limit_as_itself": Kind(small_step_limit=True, options={"law": "small_step_limit"}),
    "uneven_noise": Kind(noise_near_start=3.0),
    "heavy_tailed_repeats": Kind(repeat_freedom=3.0),
    "one_repeat": Kind(speeds_km_h=(0.0, 15.0, 25.0), loads_kN=(20.0, 30.0), repeats=1),
    "few_points": Kind(points=10, sigma_kN=0.3),
    "coarse_force": Kind(sigma_kN=1.5),
    "hardening": Kind(hardening_per_mm=0.02),
    "several_tyres": Kind(tyres=3, options={"specimen": "tyre"}),
    "several_tyres_as_one": Kind(tyres=3),
    "untested_speed": Kind(speeds_km_h=(0.0, 15.0, 20.0, 25.0, 35.0), held_out_km_h=20.0),
    "untested_speed_on_a_line": Kind(speeds_km_h=(0.0, 15.0, 20.0, 25.0, 35.0), held_out_km_h=20.0, speed_trend=True),
    "untested_speed_beyond": Kind(speeds_km_h=(0.0, 15.0, 25.0, 35.0, 50.0), held_out_km_h=50.0, speed_trend=True),
    "case_apart": Kind(speeds_km_h=(0.0, 15.0, 25.0, 35.0), case_apart=1.25),
}


def simulate(kind: Kind, seed: int, number: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the record table of a data set, and its truth, a row a record.

    The same seed and number give every kind of one design the same truths and random numbers: kinds then differ by
    their fault alone.

    Returns
    -------
    tuple of pandas.DataFrame
        The table (mm, kN); and by record the factors, `k`, `beta`, `J`, `F_i`, `case`, `k_case` and `beta_case`; and
        `contrast`, `k_ratio` and `beta_ratio`, the mean ratios over the cases, the same in all rows. Records of a speed
        held out are in the truth alone.
    """
    rng = np.random.default_rng([seed, number])
    truth = _truths(kind, rng)
    # Half a cosine in time: points lie densest at both ends.
    phase = np.concatenate([np.zeros(kind.rest_points), np.linspace(0.0, np.pi, kind.points)])
    travelled = TRAVEL_MM * (1.0 - np.cos(phase)) / 2.0
    u = np.sign(truth["step_kN"].to_numpy())[:, None] * travelled
    force = _noiseless(kind, truth, u) + _noise(kind, u, rng)
    displacement = START_MM + u + kind.displacement_noise_mm * rng.standard_normal(u.shape)
    if kind.step_of_reading_mm:
        # No two records start at one place within a step; kinds of one design keep their other random numbers.
        starts = rng.spawn(1)[0].uniform(size=(len(u), 1))
        displacement = kind.step_of_reading_mm * np.round(displacement / kind.step_of_reading_mm + starts)
    factors = truth[["record", *Case._fields, "repeat", "tyre"]]
    table = factors.loc[factors.index.repeat(len(phase))].reset_index(drop=True).assign(origin="simulated")
    table = table.assign(displacement_mm=displacement.ravel(), force_kN=force.ravel())
    return table[table["speed_km_h"] != kind.held_out_km_h].reset_index(drop=True), truth


def _truths(kind: Kind, rng: np.random.Generator) -> pd.DataFrame:
    ways = {"loading": STEP_KN, "unloading": -STEP_KN}
    levels = product(TYPICAL_K, ways, kind.speeds_km_h, kind.loads_kN)
    cases = pd.DataFrame([Case(*level, ways[level[1]]) for level in levels])
    typical = {"k": cases["configuration"].map(TYPICAL_K).to_numpy(), "beta": np.full(len(cases), kind.beta_mm)}
    grouping = {"group": cases["configuration"] + cases["direction"], "speed": cases["speed_km_h"]}
    grouping |= {"load": cases["initial_load_kN"], "remainder": pd.Series(cases.index)}
    speeds = cases["speed_km_h"].to_numpy()
    along = (speeds - speeds.mean()) / (speeds.std() or 1.0)
    for name, sd in SD.items():
        effects = {effect: _effects(levels, rng) for effect, levels in grouping.items()}
        if kind.speed_trend:
            effects["speed"] = effects["speed"][0] * along
        log_effects = sum(sd[effect] * of_cases for effect, of_cases in effects.items())
        cases[f"{name}_case"] = typical[name] * np.exp(log_effects)
    cases.loc[cases.index[-1], "k_case"] *= kind.case_apart
    cases["contrast"] = CONTRAST
    fitted, dual = cases["speed_km_h"] != kind.held_out_km_h, cases["configuration"] == "dual"
    for name in SD:
        logs = np.log(cases[f"{name}_case"])
        cases[f"{name}_ratio"] = np.exp(logs[dual & fitted].mean() - logs[~dual & fitted].mean())
    cases["case"] = [Case(*row).label for row in cases[list(Case._fields)].itertuples(index=False)]
    return _repeats(kind, cases, rng)


def _effects(levels: pd.Series, rng: np.random.Generator) -> Float[np.ndarray, " cases"]:
    """Return a standard normal number for each level, at the cases that have it."""
    codes, labels = pd.factorize(levels)
    return rng.standard_normal(len(labels))[codes]


def _repeats(kind: Kind, cases: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    records = cases.loc[cases.index.repeat(kind.repeats)].reset_index(drop=True)
    records["repeat"] = np.tile(np.arange(1, kind.repeats + 1), len(cases))
    records["record"] = records["case"] + "(" + records["repeat"].astype(str) + ")"
    for name, sd in SD.items():
        scatter = rng.standard_normal(len(records))
        if np.isfinite(kind.repeat_freedom):
            scatter /= np.sqrt(rng.chisquare(kind.repeat_freedom, len(records)) / kind.repeat_freedom)
        records[name] = records[f"{name}_case"] * np.exp(sd["repeat"] * scatter)
    records["tyre"] = (records["repeat"] - 1) % kind.tyres + 1
    if kind.tyres > 1:
        of_tyres = rng.spawn(1)[0]  # kinds of one design keep their other random numbers
        for name, sd in SD_OF_TYRES.items():
            records[name] *= np.exp(sd * _effects(records["configuration"] + records["tyre"].astype(str), of_tyres))
    J = OFFSET_KN * np.exp(SD_OFFSET * rng.standard_normal(len(records)))
    records["J"], records["F_i"] = np.sign(records["step_kN"]) * J, records["initial_load_kN"]
    return records


def _noiseless(
    kind: Kind, truth: pd.DataFrame, u: Float[np.ndarray, "records points"]
) -> Float[np.ndarray, "records points"]:
    k, beta, J, F_i = (truth[name].to_numpy()[:, None] for name in ("k", "beta", "J", "F_i"))
    risen = 1.0 - np.exp(-np.abs(u) / beta)
    half = kind.hardening_per_mm / 2.0
    secant = k * (1.0 + half * np.abs(u)) / (1.0 + half * TRAVEL_MM)  # k itself, the truth, over the whole travel
    return F_i + J * risen + secant * u * (1.0 if kind.small_step_limit else risen)


def _noise(
    kind: Kind, u: Float[np.ndarray, "records points"], rng: np.random.Generator
) -> Float[np.ndarray, "records points"]:
    noise = rng.standard_normal(u.shape)
    if np.isfinite(kind.noise_freedom):
        squares = rng.spawn(1)[0].chisquare(kind.noise_freedom, u.shape)  # kinds keep their other random numbers
        noise /= np.sqrt(squares / kind.noise_freedom)
    for i in range(1, u.shape[1]):
        noise[:, i] = kind.rho * noise[:, i - 1] + np.sqrt(1.0 - kind.rho**2) * noise[:, i]
    return kind.sigma_kN * noise * np.where(np.abs(u) < NEAR_START_MM, kind.noise_near_start, 1.0)
