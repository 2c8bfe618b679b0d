"""The reconstructed campaign: simulated records whose least-squares estimates average to the printed values.

Nothing here was measured. The printed k and beta of 48 cases (Tables 9 and 11) are real; the repeats, the paths
and the noise are assumed, as each constant below says, because the source does not publish its raw data.
"""

from typing import NamedTuple

import jax
import numpy as np
import pandas as pd

from bayes_tyre.laws.fancher import equation_2_offset
from bayes_tyre.published import tables
from bayes_tyre.record import CASE_FACTORS, FACTORS, Case
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.rig.geometry import flat_ground_start

#: Relative standard deviation of k among repeats, stationary and rolling: assumed, after the displacements of Table 8.
SD_STATIONARY, SD_ROLLING = 0.04, 0.10
#: Relative standard deviation of beta among repeats over that of k: assumed.
SD_BETA_OVER_K = 2.0
#: The source leaves out a repeat that is "significantly different" and gives no number; this multiple is an assumption.
RULE_MULTIPLE = 6.0
#: Ordinary repeats are drawn within this many standard deviations: assumed, so that none is discordant by chance.
ORDINARY_WITHIN = 2.0
REPEATS = 3
DISCORDANT_CASES_PER_CONFIGURATION = 3
DISCORDANT_K_SHIFT = (0.30, 0.45)
DISCORDANT_BETA_SHIFT = (0.45, 0.60)
#: Offset of the envelope at the start of a step, kN, and its relative standard deviation: assumed.
OFFSET_KN, OFFSET_SD = 0.4, 0.1
NOISE_KN = 0.03
SAMPLE_S = 0.0002
POINTS = (225, 256)
#: Share of a record that the source fits; the noise is made orthogonal on it and on the rest separately.
FIRST_PART = 0.7
#: Decimals in the file: with four the printed digits do not come back.
DECIMALS = 9
SEED = 2019


class Reconstruction(NamedTuple):
    """A record table and the truth it was made from, a row a record."""

    records: pd.DataFrame
    truth: pd.DataFrame


class _Truth(NamedTuple):
    """Parameters of one record: kN/mm, kN, mm, mm, kN; travel signed, mm."""

    k: float
    J: float
    beta: float
    d_i: float
    F_i: float
    travel: float

    @property
    def C(self) -> float:
        return self.J + self.F_i - self.k * self.d_i


def repeat_sd(speed_km_h: float) -> float:
    """Return the relative standard deviation of k among repeats at a speed (km/h), assumed after Table 8."""
    return SD_STATIONARY if speed_km_h == 0 else SD_ROLLING


def left_out(k_kN_per_mm: np.ndarray, sd: float, multiple: float = RULE_MULTIPLE) -> np.ndarray:
    """Return which repeat of a case the source's rule leaves out of the mean, shape (repeats,), at most one True.

    A repeat is left out when its k differs from the mean of the others by more than `multiple` times the
    relative standard deviation `sd`; of several the most distant. The source states the rule without a number ("Data
    processing", last paragraph but one): the multiple is an assumption of this project.
    """
    k = np.asarray(k_kN_per_mm, dtype=float)
    if len(k) < REPEATS:
        return np.zeros(len(k), dtype=bool)
    others = (k.sum() - k) / (len(k) - 1)
    distance = np.abs(k / others - 1.0) / sd
    out = distance > multiple
    return out & (np.arange(len(k)) == np.argmax(distance))


def case_means(fits: pd.DataFrame) -> pd.DataFrame:
    """Return the mean k and beta of every case over the repeats that the rule does not leave out.

    Parameters
    ----------
    fits:
        A row a record with the factors, `k_kN_per_mm` and `beta_mm`, such as `least_squares.csv`.

    Returns
    -------
    pandas.DataFrame
        The factors of the case, `k_kN_per_mm`, `beta_mm`, and `left_out`: the repeat left out, or missing.
    """
    rows = []
    for factors, repeats in fits.groupby([*CASE_FACTORS], sort=False):
        case = Case._make(factors)
        out = left_out(repeats["k_kN_per_mm"].to_numpy(), repeat_sd(case.speed_km_h))
        mean = repeats.loc[~out, ["k_kN_per_mm", "beta_mm"]].mean()
        discordant = repeats["repeat"].to_numpy()[out]
        rows.append({**case._asdict(), **mean.to_dict(), "left_out": discordant[0] if len(discordant) else pd.NA})
    return pd.DataFrame(rows).astype({"left_out": "Int64"})


def reconstruct(seed: int = SEED) -> Reconstruction:
    """Return the reconstructed campaign: 48 published cases, three repeats each, and its truth.

    The repeats that are not `left_out` average exactly to the printed k and beta of their case; least squares
    from d_i, F_i = first point has its stationary point at each record's truth, over the first 70 % and over
    all of the record.
    """
    rng = np.random.default_rng(seed)
    published = tables.case_means()
    discordant = _choose_discordant(published, rng)
    records, truths = [], []
    for row, published_case in published.iterrows():
        case = Case._make(published_case[name] for name in CASE_FACTORS)
        multipliers = _repeat_factors(repeat_sd(case.speed_km_h), discordant.get(row), rng)
        for repeat in range(REPEATS):
            k, beta = multipliers[repeat] * (published_case["k_kN_per_mm"], published_case["beta_mm"])
            truth = _truth(case, k, beta, rng)
            factors = {**case._asdict(), "repeat": repeat + 1}
            name = f"Dynamic{case.record(repeat + 1)}"
            records.append(_record(truth, rng).assign(record=name, **factors, origin="reconstructed"))
            truths.append(_truth_row(name, factors, truth, discordant=discordant.get(row) == repeat))
    order = ["record", *FACTORS, "time_s", "displacement_mm", "force_kN", "origin"]
    return Reconstruction(pd.concat(records, ignore_index=True)[order], pd.DataFrame(truths))


def _choose_discordant(published: pd.DataFrame, rng: np.random.Generator) -> dict[object, int]:
    """Return which repeat is discordant, by row of the published table: some standing cases of each configuration."""
    discordant: dict[object, int] = {}
    for _, cases in published[published["speed_km_h"] == 0].groupby("configuration", sort=True):
        for row in sorted(rng.choice(cases.index, DISCORDANT_CASES_PER_CONFIGURATION, replace=False)):
            discordant[row] = int(rng.integers(REPEATS))
    return discordant


def _repeat_factors(sd: float, discordant: int | None, rng: np.random.Generator) -> np.ndarray:
    """Return the factors on the case's k and beta, shape (repeats, 2); those of the others average to 1."""
    ordinary = np.arange(REPEATS) != discordant
    deviation = _within(rng, ORDINARY_WITHIN, (REPEATS, 2)) * sd * (1.0, SD_BETA_OVER_K)
    shrink = np.sqrt(ordinary.sum() / (ordinary.sum() - 1))  # centring takes a degree of freedom
    deviation[ordinary] = (deviation[ordinary] - deviation[ordinary].mean(axis=0)) * shrink
    if discordant is not None:
        shift = rng.uniform(*np.transpose([DISCORDANT_K_SHIFT, DISCORDANT_BETA_SHIFT]))
        deviation[discordant] = shift * rng.choice((-1.0, 1.0), size=2)
    return 1.0 + deviation


def _within(rng: np.random.Generator, bound: float, shape: tuple[int, ...]) -> np.ndarray:
    """Return standard normal draws, truncated at the bound by drawing again."""
    draws = rng.standard_normal(shape)
    while (beyond := np.abs(draws) > bound).any():
        draws[beyond] = rng.standard_normal(beyond.sum())
    return draws


def _truth(case: Case, k: float, beta: float, rng: np.random.Generator) -> _Truth:
    rig: Rig = load_rig(case.configuration)
    stiffness = tables.tests_stiffness(case.configuration, case.direction, case.speed_km_h)
    d_i, F_i = flat_ground_start(rig, case.initial_load_kN, stiffness)
    _, F_end = flat_ground_start(rig, case.initial_load_kN + case.step_kN, stiffness)
    J = np.sign(case.step_kN) * OFFSET_KN * (1.0 + OFFSET_SD * rng.standard_normal())
    d_i, F_i = round(float(d_i), DECIMALS), round(float(F_i), DECIMALS)
    return _Truth(k, J, beta, d_i, F_i, travel=(float(F_end) - F_i - J) / k)


def _record(truth: _Truth, rng: np.random.Generator) -> pd.DataFrame:
    """Return time (s), displacement (mm) and force (kN) of one record: a cosine ramp, which resolves small betas."""
    points = int(rng.integers(*POINTS))
    ramp = (1.0 - np.cos(np.pi * np.arange(points) / (points - 1))) / 2.0
    displacement = np.round(truth.d_i + truth.travel * ramp, DECIMALS)
    u = displacement - truth.d_i
    force = truth.F_i + _change_of_force(truth, u)
    noise = _orthogonal_noise(rng.normal(0.0, NOISE_KN, points), _tangents(truth, u))
    time = np.round(SAMPLE_S * np.arange(points), DECIMALS)
    force = np.round(force + noise, DECIMALS)
    return pd.DataFrame({"time_s": time, "displacement_mm": displacement, "force_kN": force})


def _change_of_force(truth: _Truth, u: np.ndarray) -> np.ndarray:
    """Return the force less F_i, kN, by Equation 2."""
    padded = np.pad(u, (0, POINTS[1] - len(u)))  # JAX compiles one length
    with jax.enable_x64(True):
        return np.asarray(equation_2_offset(padded, k=truth.k, J=truth.J, beta=truth.beta))[: len(u)]


def _tangents(truth: _Truth, u: np.ndarray) -> np.ndarray:
    """Return the derivatives of Equation 2 by k, C, log beta, d_i and F_i at the truth, shape (points, 5).

    Written out: automatic differentiation returns 0 for those that are below rounding, and the noise then differs.
    """
    left = np.exp(-np.abs(u) / truth.beta)
    to_go = truth.J + truth.k * u
    by_distance = to_go * left / truth.beta
    by_k = (truth.d_i + u) * (1.0 - left)
    return np.stack([by_k, 1.0 - left, -by_distance * np.abs(u), -by_distance * np.sign(u), left], axis=1)


def _orthogonal_noise(noise: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Return the noise without its component in the tangent space, separately on each part; none on the first point."""
    end = int(np.ceil(FIRST_PART * len(noise)))
    result = np.zeros_like(noise)
    for part in (slice(1, end), slice(end, None)):
        size = np.linalg.norm(tangents[part], axis=0)
        basis = tangents[part][:, size > 0] / size[size > 0]
        for _ in range(2):  # a second pass removes the rounding error of the first
            noise[part] -= basis @ np.linalg.lstsq(basis, noise[part], rcond=1e-13)[0]
        result[part] = noise[part]
    return result


def _truth_row(name: str, factors: dict[str, object], truth: _Truth, discordant: bool) -> dict[str, object]:
    values = {
        "k_kN_per_mm": truth.k,
        "C_kN": truth.C,
        "beta_mm": truth.beta,
        "J_kN": truth.J,
        "d_i_mm": truth.d_i,
        "F_i_kN": truth.F_i,
        "sigma_kN": NOISE_KN,
    }
    return {"record": name, **factors, **values, "discordant": discordant, "origin": "reconstructed"}
