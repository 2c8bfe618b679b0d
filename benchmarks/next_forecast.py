"""Whether forecasts of `next` come true. Run: python benchmarks/next_forecast.py [PLANS] [FIRST SEED] [OUTCOMES].

Each plan is of a simulated campaign of its own: it is fitted, the tests to run next are planned, these are simulated
from the same truth, and all records are fitted again. Printed is the width of the goal's interval after the refit over
the width that was forecast: how many lie within 15 %, the median and the range over the plans. A forecast is of the
mean over outcomes: with OUTCOMES above 1 each plan is carried out so many times, and the widths are averaged.
"""

import sys
from itertools import product

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.runtime import prepare_jax

CHAINS = 2
prepare_jax(CHAINS)

from bayes_tyre.inference.sampling.datatree import tree_cases  # noqa: E402  (JAX is prepared first)
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical  # noqa: E402
from bayes_tyre.inference.sampling.run import SamplerSettings  # noqa: E402
from bayes_tyre.record import Case  # noqa: E402
from bayes_tyre.record_table import check_record_table  # noqa: E402
from bayes_tyre.results.next_tests.candidates import candidates, new_cases  # noqa: E402
from bayes_tyre.results.next_tests.forecast import Forecast, forecast  # noqa: E402
from bayes_tyre.results.next_tests.goals import parse_goal  # noqa: E402
from bayes_tyre.results.next_tests.plan import Costs, choose_tests  # noqa: E402

GOALS, TESTS = (
    ("k dual / single", "beta loading / unloading", "k single (0)20-30", "beta dual (25)30-20", "k single (0)20-25"),
    6,
)
SETTINGS = SamplerSettings(CHAINS, warmup=300, draws=1000, target_accept=0.9)
REPEATS, POINTS, NOISE_KN, DISCORDANT = 3, 60, 0.03, 0.05
#: How far a width may be from its forecast, as a share of it.
NEAR = 0.15
#: Standard deviations of the logarithms of k and beta: of effects, cases, and repeats standing and rolling.
EFFECT, OF_CASE = np.array([0.08, 0.3]), np.array([0.05, 0.2])
SCATTER = {0.0: np.array([0.04, 0.08]), 25.0: np.array([0.08, 0.15])}


class Truth:
    """A tyre campaign's true values of k (kN/mm) and beta (mm), drawn case by case, and records of it."""

    def __init__(self, seed: int) -> None:
        self.rng, self.effects, self.cases = np.random.default_rng(seed), {}, {}

    def record(self, case: Case, repeat: int) -> pd.DataFrame:
        """Return one more simulated record of a case."""
        if case not in self.cases:
            levels = {"group": case[:2], "speed": case[2], "load": case[3], "step": abs(case.step_kN)}
            effects = [self._effect(level) for level in levels.items()]
            self.cases[case] = np.log([1.8, 0.05]) + sum(effects) + OF_CASE * self.rng.standard_normal(2)
        wider = 6.0 if self.rng.random() < DISCORDANT else 1.0
        k, beta = np.exp(self.cases[case] + wider * SCATTER[case.speed_km_h] * self.rng.standard_normal(2))
        u = np.sign(case.step_kN) * 3.0 * np.linspace(0.0, 1.0, POINTS) ** 2
        force = 0.7 * case.initial_load_kN + (0.4 * np.sign(case.step_kN) + k * u) * -np.expm1(-np.abs(u) / beta)
        measured = {"displacement_mm": 10.0 + u, "force_kN": force + NOISE_KN * self.rng.standard_normal(POINTS)}
        named = {"record": f"{case.label}({repeat})", **case._asdict(), "repeat": repeat, "origin": "simulated"}
        return pd.DataFrame({**measured, **named})

    def _effect(self, level: tuple[str, object]) -> np.ndarray:
        if level not in self.effects:
            self.effects[level] = EFFECT * self.rng.standard_normal(2)
        return self.effects[level]


def first_cases() -> list[Case]:
    """Return what has been tested: not every combination of the levels."""
    steps = (("loading", 20.0, 10.0), ("loading", 30.0, 5.0), ("unloading", 30.0, -10.0), ("unloading", 20.0, -5.0))
    every = product(("single", "dual"), steps, SCATTER)
    return [Case(tyre, way, speed, load, step) for tyre, (way, load, step), speed in every]


def posterior(table: pd.DataFrame, seed: int) -> xr.DataTree:
    """Return the posterior of a record table."""
    return fit_hierarchical(check_record_table(table), SamplerSettings(**{**vars(SETTINGS), "seed": seed}))


def forecast_of(tree: xr.DataTree, goal: str, like: Forecast | None = None) -> Forecast:
    """Return the forecast of a goal; with the cases that another one's goal has, where a refit has further ones."""
    cases = tree_cases(tree["posterior"].to_dataset())
    possible = candidates(tree, new_cases(cases, {}))
    parsed = parse_goal(goal, possible.cases, len(cases), possible.parameters)
    if like is not None:
        measured = len(like.weights) // len(like.cases)
        of_case = dict(zip(like.cases, like.weights.reshape(-1, measured).sum(axis=1), strict=True))
        parsed = parsed._replace(weights=np.array([of_case.get(case, 0.0) for case in possible.cases]))
    return forecast(possible, parsed)


def one_plan(seed: int, outcomes: int) -> tuple[float, str]:
    """Return the mean width of a goal after its plan has been carried out, over the forecast, and that in words."""
    truth, goal = Truth(seed), GOALS[seed % len(GOALS)]
    repeats = dict.fromkeys(first_cases(), REPEATS)
    tables = [truth.record(case, repeat) for case in repeats for repeat in range(1, REPEATS + 1)]
    before = forecast_of(posterior(pd.concat(tables, ignore_index=True), seed), goal)
    tests = choose_tests(before, 0.0, TESTS, Costs(minutes_per_test=1.0))
    expected, method = before.expected(tests)
    widths = []
    for _ in range(outcomes):
        further, counted = [], dict(repeats)
        for case in (before.cases[test] for test in tests):
            counted[case] = counted.get(case, 0) + 1
            further.append(truth.record(case, counted[case]))
        refit = posterior(pd.concat([*tables, *further], ignore_index=True), seed)
        widths.append(forecast_of(refit, goal, before).width())
    new, after = sum(test >= before.with_records for test in tests), float(np.mean(widths))
    each = f" ({', '.join(f'{width:.4f}' for width in widths)})" if outcomes > 1 else ""
    said = f"{before.width():.4f} now, {expected:.4f} forecast ({method}), {after:.4f} after the refit{each}"
    return after / expected, f"{goal}, {new} of {TESTS} tests of new cases: {said}"


def main(plans: int = 30, first: int = 0, outcomes: int = 1) -> None:
    """Print each plan, then the ratio of the refits' widths to the forecasts."""
    ratios = []
    for seed in range(first, first + plans):
        ratio, sentence = one_plan(seed, outcomes)
        ratios.append(ratio)
        print(f"{seed:3d} {sentence}, ratio {ratio:.3f}", flush=True)
    low, middle, high = np.quantile(ratios, [0.0, 0.5, 1.0])
    near = sum(abs(ratio - 1.0) <= NEAR for ratio in ratios)
    about = f"{near} within {NEAR:.0%}, mean {np.mean(ratios):.3f}, median {middle:.3f}, range {low:.3f} to {high:.3f}"
    print(f"simulated, {plans} plans: refit over forecast: {about}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
