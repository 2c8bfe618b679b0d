"""Least squares of k, C, beta, and F_i where it is free, record by record: ours against scipy and lmfit in a loop.

Run ``python benchmarks/least_squares_peers.py [--quick]``; prints a Markdown table. Compilation apart. The peers get
numpy arrays, the start of the thesis (its line, beta 0.1 mm), log beta as unknown, and no work that the fit does not
need; they are measured on some records and scaled. Ours does more: standard errors, both ends of beta's profile, and
a second start from the data.
"""

import sys
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from least_squares_scale import simulated
from lmfit import Parameters, minimize
from scipy.optimize import least_squares

CAMPAIGN = Path(__file__).parents[1] / "data/campaign/records.csv"
KEPT, LINE_FROM, BETA_MM = 0.7, 0.2, 0.1
#: Records that a peer is measured on, at most.
MEASURED = 200
#: Records that ours is given at a time.
BATCH = 256


class Record(NamedTuple):
    """Displacement (mm) and force (kN) of a record; the start: k (kN/mm), C (kN), log beta (mm), F_i (kN) where free.

    F_i that is not free is the first force, as in the thesis.
    """

    d: np.ndarray
    F: np.ndarray
    start: np.ndarray


class Cost(NamedTuple):
    """Seconds of the clock and of all cores, a record; estimates of k, C and beta, a row a record."""

    wall: float
    cpu: float
    estimates: np.ndarray


def records_of(table: pd.DataFrame, kept: float, level: bool) -> list[Record]:
    """Return the first part of each record, with the thesis's start; `level`: F_i is free."""
    found = []
    for _, rows in table.groupby("record", sort=False):
        d, F = rows["displacement_mm"].to_numpy(), rows["force_kN"].to_numpy()
        last, begin = int(np.ceil(kept * len(d))) - 1, int(np.ceil(LINE_FROM * len(d))) - 1
        k = (F[last] - F[begin]) / (d[last] - d[begin])
        start = [k, F[begin] - k * d[begin], np.log(BETA_MM), *[F[0]] * level]
        found.append(Record(d[: last + 1], F[: last + 1], np.array(start)))
    return found


def residual_of(record: Record) -> Callable[[np.ndarray], np.ndarray]:
    """Return Equation 2 less the force as a function of k, C, log beta, and F_i where the record has it free."""
    d, F, distance, F_i, behind = (
        record.d,
        record.F,
        np.abs(record.d - record.d[0]),
        record.F[0],
        record.F[0] - record.F,
    )

    def residual(x: np.ndarray) -> np.ndarray:
        return (x[0] * d + (x[1] - F_i)) * (1.0 - np.exp(distance * -np.exp(-x[2]))) + behind

    def with_level(x: np.ndarray) -> np.ndarray:
        return (x[0] * d + (x[1] - x[3])) * (1.0 - np.exp(distance * -np.exp(-x[2]))) + (x[3] - F)

    return with_level if len(record.start) > 3 else residual


def jacobian_of(record: Record) -> Callable[[np.ndarray], np.ndarray]:
    """Return the derivative of `residual_of`."""
    d, distance, level = record.d, np.abs(record.d - record.d[0]), len(record.start) > 3

    def jacobian(x: np.ndarray) -> np.ndarray:
        rate, columns, F_i = np.exp(-x[2]), np.empty((len(d), len(x))), x[3] if level else record.F[0]
        decay = np.exp(distance * -rate)
        gone = 1.0 - decay
        columns[:, 0], columns[:, 1] = d * gone, gone
        columns[:, 2] = (x[0] * d + (x[1] - F_i)) * (distance * decay * -rate)
        if level:
            columns[:, 3] = decay
        return columns

    return jacobian


def by_scipy(record: Record, analytic: bool) -> np.ndarray:
    """Return k, C, beta by MINPACK's Levenberg-Marquardt."""
    jac = jacobian_of(record) if analytic else "2-point"
    x = least_squares(residual_of(record), record.start, jac=jac, method="lm").x
    return np.array([x[0], x[1], np.exp(x[2])])


def by_lmfit(record: Record) -> np.ndarray:
    """Return k, C, beta by lmfit's `leastsq`."""
    parameters, residual = Parameters(), residual_of(record)
    names = ("k", "C", "log_beta", "F_i")[: len(record.start)]
    for name, value in zip(names, record.start, strict=True):
        parameters.add(name, value=value)

    def of(parameters: Parameters) -> np.ndarray:
        return residual(np.array([parameters[name].value for name in names]))

    found = minimize(of, parameters, method="leastsq").params
    return np.array([found["k"].value, found["C"].value, np.exp(found["log_beta"].value)])


def timed(work: Callable[[], np.ndarray], records: int, runs: int) -> Cost:
    """Return the least of several runs."""
    wall, cpu, estimates = [], [], np.empty(0)
    for _ in range(runs):
        began, used = time.perf_counter(), time.process_time()
        estimates = work()
        wall.append((time.perf_counter() - began) / records)
        cpu.append((time.process_time() - used) / records)
    return Cost(min(wall), min(cpu), estimates)


def ours(records: list[Record], given: bool, runs: int) -> Cost:
    """Return our cost: arrays in, estimates out, a batch a core at a time; `given`: the thesis's start beside ours."""
    import jax
    import jax.numpy as jnp

    from bayes_tyre.inference.least_squares.estimate import BETA, C, K, Problem, estimate_batch
    from bayes_tyre.inference.least_squares.parameters import F_I

    width = max(len(record.d) for record in records)

    def rows(field: Callable[[Record], np.ndarray]) -> np.ndarray:
        return np.stack([np.append(field(r), np.full(width - len(r.d), field(r)[0])) for r in records])

    d, F = rows(lambda r: r.d), rows(lambda r: r.F)
    used = np.arange(width) < np.array([len(r.d) for r in records])[:, None]
    nan, free = np.full((len(records), 5), np.nan), (K, C, BETA, *[F_I] * (len(records[0].start) > 3))
    start = nan.copy()
    start[:, free] = [[*r.start[:2], np.exp(r.start[2]), *r.start[3:]] for r in records]
    starts = np.stack([start, nan], axis=1) if given else nan[:, None]

    def batch(first: int) -> np.ndarray:
        here = np.minimum(np.arange(first, first + min(BATCH, len(d))), len(d) - 1)
        problem = Problem(*(jnp.asarray(array[here]) for array in (d, F, used, nan, starts)))
        value = np.asarray(jax.block_until_ready(estimate_batch(problem, free).value)[:, [K, C, BETA]])
        return value[: len(d) - first]

    batch(0)  # compiles
    with ThreadPoolExecutor(cpu_count()) as pool:
        firsts = range(0, len(d), BATCH)
        return timed(lambda: np.concatenate(list(pool.map(batch, firsts))), len(d), runs)


def whole(table: pd.DataFrame, region: str, level: bool, runs: int) -> Cost:
    """Return the cost of `fit_records`: a checked table in, a table with statuses and words out."""
    from bayes_tyre.inference.least_squares.table import FitSettings, fit_records

    free = ("k", "C", "beta", *["F_i"] * level)
    columns, settings = ["k_kN_per_mm", "C_kN", "beta_mm"], FitSettings(region=region, free=free)
    fit_records(table, settings)  # compiles
    return timed(lambda: fit_records(table, settings)[columns].to_numpy(), table["record"].nunique(), runs)


def told(title: str, table: pd.DataFrame, region: str, runs: int, level: bool = False) -> None:
    """Print what one set of records costs, and how far the estimates are apart; `level`: F_i is free."""
    records = records_of(table, KEPT if region == "thesis" else 1.0, level)
    some = records[:: max(1, len(records) // MEASURED)][:MEASURED]
    costs = {
        "bayes_tyre, arrays to estimates": ours(records, region == "thesis", runs),
        "bayes_tyre, table to table": whole(table, region, level, runs),
        "scipy `least_squares(method='lm')`, analytic Jacobian": timed(
            lambda: np.stack([by_scipy(record, True) for record in some]), len(some), runs
        ),
        "scipy `least_squares(method='lm')`, 2-point": timed(
            lambda: np.stack([by_scipy(record, False) for record in some]), len(some), runs
        ),
        "lmfit `minimize(method='leastsq')`": timed(
            lambda: np.stack([by_lmfit(record) for record in some]), len(some), runs
        ),
    }
    first = costs["bayes_tyre, arrays to estimates"]
    print(f"\n{title}: {len(records):,} records of up to {max(len(r.d) for r in records)} points; peers measured on")
    print(f"{len(some)} of them. Ratios: of the clock, and of processor time (ours runs on {cpu_count()} cores).\n")
    print("| | us a record | processor us | records a second | ratio | ratio of processor time | farthest beta |")
    print("|---|---|---|---|---|---|---|")
    step = max(1, len(records) // MEASURED)
    for name, cost in costs.items():
        mine = first.estimates if len(cost.estimates) == len(records) else first.estimates[::step][:MEASURED]
        apart = np.nanmax(np.abs(cost.estimates[:, 2] / mine[:, 2] - 1.0))
        ratios = f"{cost.wall / first.wall:.1f} | {cost.cpu / first.cpu:.1f}"
        print(
            f"| {name} | {1e6 * cost.wall:.0f} | {1e6 * cost.cpu:.0f} | {1 / cost.wall:,.0f} | {ratios} | {apart:.0e} |"
        )


def main() -> None:
    """Measure the campaign and a large simulated table."""
    from bayes_tyre.formats.tables.table_files import read_table
    from bayes_tyre.record_table import check_record_table
    from bayes_tyre.runtime import prepare_jax

    prepare_jax()
    quick = "--quick" in sys.argv[1:]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        campaign = check_record_table(read_table(CAMPAIGN))
    told("Reconstructed campaign, region thesis", campaign, "thesis", runs=3)
    many = check_record_table(simulated(1_000 if quick else 10_000, 838))
    told("Simulated, all points, F_i the first force", many, "all", runs=2 if quick else 3)
    told("Simulated, all points, F_i free", many, "all", runs=2 if quick else 3, level=True)


if __name__ == "__main__":
    main()
