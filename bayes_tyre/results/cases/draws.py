"""Draws of what the law of one step needs: those of a case, or of one more repeat of it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.record_levels import LEVELS
from bayes_tyre.inference.sampling.datatree import case_parameters, draws_in_a_row, tree_cases
from bayes_tyre.record import CASE_FACTORS, Case


class CaseDraws(NamedTuple):
    """Parameters of one step, each of shape (draws,).

    Attributes
    ----------
    F_i, J:
        Force at the start, and envelope less force at the start, kN.
    k, beta:
        Slope of the envelope, kN/mm; displacement over which the force approaches it, mm.
    d_i:
        Displacement at the start, mm.
    sigma:
        Noise of a single point, kN; 0 where a curve is meant and no measurement.
    noise_nu:
        Degrees of freedom of that noise; None: it is normal.
    """

    F_i: Float[np.ndarray, " draws"]
    J: Float[np.ndarray, " draws"]
    k: Float[np.ndarray, " draws"]
    beta: Float[np.ndarray, " draws"]
    d_i: Float[np.ndarray, " draws"]
    sigma: Float[np.ndarray, " draws"]
    noise_nu: Float[np.ndarray, " draws"] | None = None

    @property
    def C(self) -> Float[np.ndarray, " draws"]:
        """Force of the envelope at zero displacement, kN."""
        return self.F_i + self.J - self.k * self.d_i


def thinned(draws: CaseDraws, count: int) -> CaseDraws:
    """Return so many of the draws, evenly spaced."""
    *values, nu = draws
    nu = None if nu is None else evenly_spaced(nu, count)
    return CaseDraws(*(evenly_spaced(each, count) for each in values), noise_nu=nu)


def evenly_spaced(draws: Float[np.ndarray, " draws"], count: int) -> Float[np.ndarray, " count"]:
    """Return so many of some draws."""
    return draws[np.linspace(0, len(draws) - 1, count).round().astype(int)]


def joined(parts: Sequence[CaseDraws]) -> CaseDraws:
    """Return draws one after the other, without their noise, which need not be of one kind."""
    return CaseDraws(*(np.concatenate(each) for each in list(zip(*parts, strict=True))[:-1]))


class Start(NamedTuple):
    """Where the records of a case start, each of shape (draws, records).

    Attributes
    ----------
    F_i, J:
        Force at the start, and envelope less force at the start, kN.
    d_i:
        Displacement at the start, mm; NaN where no record says it.
    """

    F_i: Float[np.ndarray, "draws records"]
    J: Float[np.ndarray, "draws records"]
    d_i: Float[np.ndarray, "draws records"]


class CaseValues(NamedTuple):
    """A case, with draws of its k (kN/mm) and beta (mm), and where its records start."""

    case: Case
    k: Float[np.ndarray, " draws"]
    beta: Float[np.ndarray, " draws"]
    start: Start

    def mean(self) -> CaseDraws:
        """Return the draws of the case: F_i, J, d_i, which have no case level, as means over its records."""
        F_i, J, d_i = (draws.mean(axis=1) for draws in self.start)
        return CaseDraws(F_i, J, self.k, self.beta, d_i, np.zeros_like(self.k))


def parameters_of_case(posterior: xr.Dataset, case: int) -> dict[str, Float[np.ndarray, " draws"]]:
    """Return the draws of each parameter of a case that has records: of its k (kN/mm), its beta (mm), ..."""
    return {name: draws_in_a_row(posterior[f"{name}_case"].isel(case=case)) for name in case_parameters(posterior)}


def tested(posterior: xr.Dataset, case: int) -> CaseValues:
    """Return a case that has records."""
    of_case, factors = parameters_of_case(posterior, case), tree_cases(posterior)[case]
    records = records_like(posterior, factors)
    if not records:
        raise BadInput(f"case {case + 1} has no record; run fit again")
    return CaseValues(factors, of_case["k"], of_case["beta"], start_of(posterior, records))


def of_repeat(
    posterior: xr.Dataset, values: CaseValues, rng: np.random.Generator, discordant_widening: float
) -> CaseDraws:
    """Return the draws of a repeat of a case that was not measured.

    k and beta scatter about the case's as repeats do at its speed, as a discordant repeat as often as the posterior
    holds one possible (with the posterior's tails, where repeats are a Student-t), and as specimens and days do, where
    the model has these: it is made on another tyre, on another day, at the mean of the covariates. F_i, J and d_i are
    those of one of the case's records; sigma is that of a new record.

    Raises
    ------
    BadInput
        If the posterior does not hold the scatter of repeats or the noise.
    """
    draws, records = values.start.F_i.shape
    one = (np.arange(draws), rng.integers(records, size=draws))
    widening = _widening(posterior, draws, rng, discordant_widening)
    speed = values.case.speed_km_h
    sds = {
        name: np.hypot(widening * sd_of_repeats(posterior, name, speed), _sd_of_levels(posterior, name))
        for name in ("k", "beta")
    }
    k, beta = (getattr(values, name) * np.exp(sd * rng.standard_normal(draws)) for name, sd in sds.items())
    # sigma of one record does not vary.
    sd_log_sigma = _scalar(posterior, "sd_log_sigma") if "sd_log_sigma" in posterior else 0.0
    sigma = _scalar(posterior, "sigma_typical") * np.exp(sd_log_sigma * rng.standard_normal(draws))
    F_i, J, d_i = (draws[one] for draws in values.start)
    nu = _scalar(posterior, "noise_nu") if "noise_nu" in posterior else None
    return CaseDraws(F_i, J, k, beta, d_i, sigma, nu)


def draw_noise(
    rng: np.random.Generator, shape: tuple[int, ...], nu: Float[np.ndarray, "*#shape"] | None
) -> Float[np.ndarray, "*shape"]:
    """Return noise of scale 1: a Student-t of so many degrees of freedom; None: normal."""
    return rng.standard_normal(shape) if nu is None else rng.standard_t(nu, shape)


def _sd_of_levels(posterior: xr.Dataset, parameter: str) -> Float[np.ndarray, "#draws"]:
    """Return the standard deviation of a specimen and a day that were not measured; 0 where the model has neither."""
    sds = (f"sd_log_{parameter}_{level}" for level in LEVELS)
    return np.sqrt(sum((draws_in_a_row(posterior[sd]) ** 2 for sd in sds if sd in posterior), np.zeros(1)))


def _widening(
    posterior: xr.Dataset, draws: int, rng: np.random.Generator, discordant_widening: float
) -> Float[np.ndarray, " draws"]:
    """Return how much more widely than usual a repeat scatters, in k and beta together."""
    if "student_nu" in posterior:
        nu = _scalar(posterior, "student_nu")
        return np.sqrt(nu / rng.chisquare(nu))
    weight = _scalar(posterior, "discordant_weight") if "discordant_weight" in posterior else 0.0
    return np.where(rng.random(draws) < weight, discordant_widening, 1.0)


def travel_mm(posterior: xr.Dataset, case: Case) -> float:
    """Return how far the case's records go from their start, mm.

    A case without any goes as far for its step as those of its configuration and direction do, in the median.

    Raises
    ------
    BadInput
        If the posterior does not say.
    """
    if "record_travel_mm" not in posterior.coords:
        raise BadInput("the posterior does not say how far its records go; give displacements, such as 0:3:101")
    travel = posterior["record_travel_mm"].to_numpy()
    if records := records_like(posterior, case):
        return float(travel[records].max())
    records = records_like(posterior, case, CASE_FACTORS[:2])
    if case.step_kN is None:
        return float(travel[records].max())
    steps = posterior["record_step_kN"].to_numpy()[records]
    return float(np.median(travel[records] / np.abs(steps)) * abs(case.step_kN))


def start_of(posterior: xr.Dataset, records: list[int]) -> Start:
    """Return where some records start."""
    by_name = {
        name: posterior[name].transpose("chain", "draw", "record").to_numpy()[..., records].reshape(-1, len(records))
        for name in ("F_i", "J", "C", "k")
    }
    d_i = (by_name["F_i"] + by_name["J"] - by_name["C"]) / by_name["k"]
    return Start(by_name["F_i"], by_name["J"], d_i)


def records_like(posterior: xr.Dataset, case: Case, factors: Sequence[str] = CASE_FACTORS) -> list[int]:
    """Return the indices of the records that share some factors with a case."""
    shared = [CASE_FACTORS.index(factor) for factor in factors]
    wanted = [None if case[i] == "" else case[i] for i in shared]
    along = factors_along(posterior, "record")
    return [record for record, values in enumerate(along) if [values[i] for i in shared] == wanted]


def factors_along(posterior: xr.Dataset, dim: str) -> list[tuple[object, ...]]:
    """Return the factors along a dimension; None for one that the data did not have."""
    unknown = [None] * posterior.sizes[dim]
    names = (f"{dim}_{factor}" for factor in CASE_FACTORS)
    columns = [posterior[name].to_numpy().tolist() if name in posterior.coords else unknown for name in names]
    return [tuple(None if v != v or v == "" else v for v in row) for row in zip(*columns, strict=True)]


def _scalar(posterior: xr.Dataset, name: str) -> np.ndarray:
    if name not in posterior:
        raise BadInput(f"the posterior lacks {name}, so no repeat can be predicted; ask for the case, or run fit again")
    return draws_in_a_row(posterior[name])


def sd_of_repeats(posterior: xr.Dataset, parameter: str, speed_km_h: float | None) -> Float[np.ndarray, " draws"]:
    """Return the scatter of repeats of a parameter's logarithm at a speed; the typical one at a speed not driven."""
    name = f"sd_log_{parameter}_repeat"
    if f"{name}_by_speed" not in posterior:
        return _scalar(posterior, name)
    speeds = [str(level) for level in posterior["speed"].to_numpy().tolist()]  # text beside numbers is stored as text
    wanted = "" if speed_km_h is None or np.isnan(speed_km_h) else str(float(speed_km_h))
    return (
        draws_in_a_row(posterior[f"{name}_by_speed"])[:, speeds.index(wanted)]
        if wanted in speeds
        else _scalar(posterior, name)
    )
