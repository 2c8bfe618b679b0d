"""A flexible ring fitted to measured natural frequencies: least squares, posterior, misfit, and what is identified.

Few frequencies leave a thin, curved ridge of rings that fit alike, along which chains of NUTS diverge. But rings of one
natural frequency lie on a plane of the four parameters: draws from the prior of what the frequencies leave open,
completed by what they determine, lie on the ridge, and importance weights correct their density.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float
from numpyro import distributions as dist
from scipy import linalg, stats

from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST, smooth_log_weights
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.model.priors import Prior
from bayes_tyre.laws.flexible_ring import FlexibleRing

PARAMETERS = ("bending", "tension", "radial", "tangential")
SIGMA = "sigma"
_WIDE = "the order of magnitude of tyres; in 95 % a factor of 19 either way"


def _log_normal(median: float, sd_log: float, unit: str, reason: str) -> Prior:
    return Prior(dist.LogNormal, (float(np.log(median)), sd_log), unit, reason)


PRIORS = {
    "bending": _log_normal(50.0, 2.0, "1/s^2", "the order of magnitude of belts; in 95 % a factor of 50 either way"),
    "tension": _log_normal(3e4, 1.5, "1/s^2", _WIDE),
    "radial": _log_normal(2e5, 1.5, "1/s^2", f"mode 1 near 60 Hz; {_WIDE}"),
    "tangential": _log_normal(6e4, 1.5, "1/s^2", _WIDE),
    SIGMA: _log_normal(1.0, 1.0, "Hz", "frequencies read to 0.1 to 7 Hz"),
}
#: Of tension where pressures are given: per bar.
TENSION_PER_BAR = _log_normal(1e4, 1.5, "1/s^2/bar", f"T = p b R; {_WIDE}")
#: A parameter is identified where its posterior is so many times narrower than its prior, both of the logarithm.
NARROWER = 3.0
#: Probability of a larger misfit by chance at which the ring is refuted; singular values that count as zero; weight on
#: the priors that keeps least squares from running off where nothing else does.
REFUTED, _ZERO, _FAINT = 0.01, 1e-9, 1e-3
#: Draws of the proposal, and of the posterior; the fewest effective ones.
_PROPOSED, DRAWS, EFFECTIVE_LEAST = 100_000, 4000, 400
#: The proposal: Student-t with these degrees of freedom, this much wider than the frequencies say.
_TAILS, _WIDENING = 7.0, 1.1
#: A parameter is solved for where its prior median changes frequencies by so many standard deviations. With fewer, the
#: prior's density near zero would leave a few draws with large weights.
_SOLVED = 3.0


class MeasuredModes(NamedTuple):
    """Measured natural frequencies; every field has shape (frequencies,).

    Attributes
    ----------
    mode, frequency_Hz:
        Waves around the ring, and as measured.
    sd_Hz:
        Standard deviation of each; None: one that is not known.
    pressure_bar:
        None: tension is the same in all.
    spin, wave:
        As `FlexibleRing.frequencies` has them.
    """

    mode: np.ndarray
    frequency_Hz: np.ndarray
    sd_Hz: np.ndarray | None
    pressure_bar: np.ndarray | None
    spin: np.ndarray
    wave: np.ndarray

    @property
    def priors(self) -> dict[str, Prior]:
        """The priors of what is unknown: `PARAMETERS`, and `SIGMA` where no standard deviation is given."""
        tension = {} if self.pressure_bar is None else {"tension": TENSION_PER_BAR}
        return {name: (PRIORS | tension)[name] for name in PRIORS if name != SIGMA or self.sd_Hz is None}

    def fitted(self, values: Float[Array, " 4"]) -> Float[Array, " frequencies"]:
        """Return the frequencies, Hz, of the ring with these `PARAMETERS`."""
        ring = dict(zip(PARAMETERS, values, strict=True))
        tension = ring["tension"] * (1.0 if self.pressure_bar is None else self.pressure_bar)
        return FlexibleRing(**ring | {"tension": tension}).frequencies(self.mode, self.spin, self.wave)


class RingFit(NamedTuple):
    """A ring fitted to frequencies.

    Attributes
    ----------
    draws:
        Of the posterior, by name of `MeasuredModes.priors`, shape (draws,).
    frequencies:
        Of the ring of each draw, Hz, shape (draws, frequencies).
    rank:
        How many combinations of the four parameters such modes determine.
    status:
        By name: ``ok``, or that it is not identified.
    checks:
        Of the draws, and of the misfit where standard deviations are given.
    """

    draws: dict[str, np.ndarray]
    frequencies: np.ndarray
    rank: int
    status: dict[str, str]
    checks: list[Check]

    @property
    def verdict(self) -> str:
        """``pass`` where every check has passed, else ``fail``."""
        return "pass" if all(check.passed for check in self.checks) else "fail"


def fit_ring(modes: MeasuredModes, seed: int = 0) -> RingFit:
    """Return the posterior of a flexible ring under `MeasuredModes.priors`, and whether frequencies contradict it."""
    likely, best = (np.exp(_least_squares(modes, weight)) for weight in (1.0, _FAINT))
    singular = np.linalg.svd(np.asarray(jax.jacfwd(modes.fitted)(jnp.asarray(likely))) * likely, compute_uv=False)
    rank = int((singular > _ZERO * singular[0]).sum())
    rng = np.random.default_rng(seed)
    proposed = _weighted(modes, likely, rank, rng)
    log_weights, pareto_k = proposed.log_weights, np.nan
    if len(log_weights) >= EFFECTIVE_LEAST:  # fewer have no tail to be smoothed, and fail
        log_weights, pareto_k = smooth_log_weights(log_weights)
    weights = np.exp(log_weights - log_weights.max())
    chosen = rng.choice(len(weights), DRAWS, p=weights / weights.sum())
    unknowns = np.column_stack([proposed.values, proposed.sigma])[chosen]
    draws = dict(zip(modes.priors, unknowns.T, strict=False))  # sigma comes last, where it is unknown
    frequencies = np.asarray(jax.vmap(modes.fitted)(jnp.asarray(proposed.values[chosen])))
    sampling = _sampling(pareto_k, float(weights.sum() ** 2 / (weights**2).sum()))
    sampled = all(check.passed for check in sampling)
    status = {
        name: _status(prior, np.log(draws[name])) if sampled else "not determined: the sampling failed"
        for name, prior in modes.priors.items()
    }
    return RingFit(draws, frequencies, rank, status, [*sampling, *_misfit(modes, best, rank)])


class _Weighted(NamedTuple):
    """Draws of `PARAMETERS`, and of a standard deviation, Hz, with their log weights."""

    values: Float[np.ndarray, "draws 4"]
    sigma: Float[np.ndarray, " draws"]
    log_weights: Float[np.ndarray, " draws"]


def _least_squares(modes: MeasuredModes, weight: float) -> Float[np.ndarray, " 4"]:
    """Return the logarithms of the parameters that fit best, with so much weight on their priors."""
    location, scale = (jnp.asarray([modes.priors[name].parameters[i] for name in PARAMETERS]) for i in (0, 1))
    sd = 1.0 if modes.sd_Hz is None else modes.sd_Hz

    def residuals(logarithms: Float[Array, " 4"], _: None) -> Float[Array, " residuals"]:
        misfit = (modes.fitted(jnp.exp(logarithms)) - modes.frequency_Hz) / sd
        return jnp.concatenate([misfit, weight * (logarithms - location) / scale])

    solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    return np.asarray(optx.least_squares(residuals, solver, location, max_steps=1000, throw=False).value)


class _Deviations(NamedTuple):
    """Standard deviations of the frequencies: a typical one of each, Hz, each draw's over that, and its log weight."""

    typical: Float[np.ndarray, " frequencies"]
    ratio: Float[np.ndarray, "draws 1"]
    log_weights: Float[np.ndarray, " draws"]


def _deviations(
    modes: MeasuredModes, left: Float[np.ndarray, " frequencies"], rank: int, rng: np.random.Generator
) -> _Deviations:
    """Return the standard deviations given; or draws of an unknown one about what the residuals `left`, Hz, say."""
    if modes.sd_Hz is not None:
        return _Deviations(modes.sd_Hz, np.ones((_PROPOSED, 1)), np.zeros(_PROPOSED))
    location, scale = modes.priors[SIGMA].parameters
    faint = 0.3  # of an observation: the prior's part in the typical one
    typical = np.sqrt((left @ left + faint * np.exp(2 * location)) / (len(left) - rank + faint))
    noise = rng.standard_normal(_PROPOSED)
    prior = -0.5 * ((np.log(typical) + scale * noise - location) / scale) ** 2
    return _Deviations(np.full(len(left), typical), np.exp(scale * noise)[:, None], prior + 0.5 * noise**2)


def _weighted(modes: MeasuredModes, likely: Float[np.ndarray, " 4"], rank: int, rng: np.random.Generator) -> _Weighted:
    """Return draws near the posterior, and their log weights.

    What the frequencies determine is solved for, about the likely values and given draws of the other parameters from
    their priors.
    """
    location, scale = (np.asarray([modes.priors[name].parameters[i] for name in PARAMETERS]) for i in (0, 1))
    unit, slopes = np.exp(location), np.asarray(jax.jacfwd(modes.fitted)(jnp.asarray(likely)))
    left = modes.frequency_Hz - np.asarray(modes.fitted(jnp.asarray(likely)))
    typical, ratio, log_weights = _deviations(modes, left, rank, rng)
    pivoted: Any = linalg.qr(slopes * unit / typical[:, None], mode="economic", pivoting=True)
    _, r, order = pivoted
    count = int((np.abs(np.diag(r)) > _SOLVED).sum())
    solved, drawn = order[:count], order[count:]
    values = unit * np.exp(scale * rng.standard_normal((_PROPOSED, len(unit))))
    noise = rng.standard_normal((_PROPOSED, count)) / np.sqrt(rng.chisquare(_TAILS, (_PROPOSED, 1)) / _TAILS)
    given = (values[:, drawn] - likely[drawn]) / unit[drawn]
    determined = _WIDENING * ratio * noise - given @ r[:count, count:].T
    values[:, solved] = likely[solved] + unit[solved] * linalg.solve_triangular(r[:count, :count], determined.T).T
    values[0] = likely  # so that there is one, where frequencies contradict every ring
    possible = (values > 0).all(axis=1)
    values = np.where(possible[:, None], values, unit)
    fitted = np.asarray(jax.jit(jax.vmap(modes.fitted))(jnp.asarray(values)))
    log_weights += stats.norm.logpdf(modes.frequency_Hz, fitted, ratio * typical).sum(axis=1)
    log_weights += stats.lognorm.logpdf(values[:, solved], scale[solved], scale=unit[solved]).sum(axis=1)
    # Over the proposal's density: Student's, its volume as the standard deviation to the power of its dimensions.
    log_weights += (_TAILS + count) / 2 * np.log1p((noise**2).sum(axis=1) / _TAILS) + count * np.log(ratio[:, 0])
    return _Weighted(values[possible], (ratio * typical)[possible, 0], log_weights[possible])


def _sampling(pareto_k: float, effective: float) -> list[Check]:
    """Return the checks of the importance weights."""
    remedy = "give more modes, or larger standard deviations where these are too small to be true"
    tail = f"Pareto k of the importance weights {pareto_k:.2f}, at most {PARETO_K_MOST} needed"
    few = f"{effective:.0f} effective draws are fewer than {EFFECTIVE_LEAST}"
    return [
        Check("pareto_k", "sampling", pareto_k <= PARETO_K_MOST, pareto_k, PARETO_K_MOST, "", tail, remedy),
        Check("effective", "sampling", effective >= EFFECTIVE_LEAST, effective, EFFECTIVE_LEAST, "", few, remedy),
    ]


def _misfit(modes: MeasuredModes, best: Float[np.ndarray, " 4"], rank: int) -> list[Check]:
    """Return the chi-squared test of the standard deviations given; none where nothing is left to test."""
    spare = len(modes.mode) - rank
    if modes.sd_Hz is None or spare == 0:
        return []
    left = (np.asarray(modes.fitted(jnp.asarray(best))) - modes.frequency_Hz) / modes.sd_Hz
    value, limit = float(left @ left), float(stats.chi2.ppf(1 - REFUTED, spare))
    where = f"mode {modes.mode[np.abs(left).argmax()]:g}"
    finding = (
        f"the ring misses the frequencies by more than their standard deviations: chi-squared {value:.3g} with "
        f"{spare} degrees of freedom is above {limit:.3g}, {where} is off most"
    )
    remedy = "check mode numbers and standard deviations; if they are right, the tyre is no such ring"
    return [Check("ring", "model", value <= limit, value, limit, where, finding, remedy)]


def _status(prior: Prior, logarithms: Float[np.ndarray, " draws"]) -> str:
    location, scale = prior.parameters
    narrower = scale / float(logarithms.std())
    if narrower >= NARROWER:
        return "ok"
    low, high = (np.quantile(logarithms, [0.025, 0.975]) - location) / scale
    # One standard deviation of the prior inside its own limits, on one side alone.
    bounds = {(True, False): "an upper bound only; ", (False, True): "a lower bound only; "}
    side = bounds.get((bool(high < 0.96), bool(low > -0.96)), "")
    return f"not identified: {side}{narrower:.1f} times narrower than its prior, {NARROWER:g} needed"
