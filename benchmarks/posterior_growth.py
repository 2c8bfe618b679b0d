"""The hierarchical posterior of many records: how time and memory grow. Run: python benchmarks/posterior_growth.py.

The collapsed sampler on simulated records, and of few the joint one, each fit in a process of its own: its time
includes compilation, its peak memory is its own. With --quick, the smallest size alone; with --figure FILE, the largest
size too, which takes longer than all others, and a figure.
"""

import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from least_squares_scale import peak_mb

#: Configurations of a table, each with 288 records in 96 cases, by the sampler. All records sampled are not waited for.
SIZES = {"collapsed": (1, 5, 10), "joint": (1,)}
#: The size that a figure has beside these.
LARGEST = (50, "collapsed")
SPEEDS, LOADS, STEPS = (0.0, 15.0, 25.0, 35.0), (15.0, 20.0, 25.0, 30.0, 35.0, 40.0), (-10.0, -5.0, 5.0, 10.0)
REPEATS, POINTS = 3, 60
NOISE_KN, SCATTER, CHAINS, WARMUP, DRAWS = 0.03, 0.04, 4, 500, 500


def simulated(configurations: int) -> pd.DataFrame:
    """Return records of Equation 2 with noise, kN and mm, as repeats of cases."""
    rng, tables = np.random.default_rng(0), []
    cases = [(c, s, load, step) for c in range(configurations) for s in SPEEDS for load in LOADS for step in STEPS]
    for configuration, speed, load, step in cases:
        k_case, beta_case = 1.8 * np.exp(rng.normal(0, 0.1)), 0.05 * np.exp(rng.normal(0, 0.3))
        u = np.sign(step) * 3.0 * (1 - np.cos(np.pi * np.linspace(0, 1, POINTS))) / 2
        for repeat in range(1, REPEATS + 1):
            k, beta = k_case * np.exp(rng.normal(0, SCATTER)), beta_case * np.exp(rng.normal(0, 2 * SCATTER))
            force = 0.7 * load + (0.4 * np.sign(step) + k * u) * -np.expm1(-np.abs(u) / beta)
            words = {"configuration": f"tyre {configuration}", "direction": "loading" if step > 0 else "unloading"}
            words |= {"speed_km_h": speed, "initial_load_kN": load, "step_kN": step, "repeat": repeat}
            frame = {"displacement_mm": 10.0 + u, "force_kN": force + rng.normal(0, NOISE_KN, POINTS)}
            record = f"tyre {configuration} ({speed:g}){load:g}-{load + step:g}({repeat})"
            tables.append(pd.DataFrame(frame).assign(record=record, **words, origin="simulated"))
    return pd.concat(tables, ignore_index=True)


def measure(configurations: int, sampler: str) -> dict[str, object]:
    """Return seconds, steps a draw, the worst effective sample size and the peak memory of one fit."""
    from bayes_tyre.runtime import prepare_jax

    prepare_jax(CHAINS)
    from bayes_tyre.inference.diagnostics.convergence import monitor, worst
    from bayes_tyre.inference.model.settings import ModelSettings
    from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
    from bayes_tyre.inference.sampling.run import SamplerSettings, sampler_runs
    from bayes_tyre.record_table import check_record_table

    table = check_record_table(simulated(configurations))
    start = time.perf_counter()
    settings = SamplerSettings(CHAINS, WARMUP, DRAWS, target_accept=0.8)
    tree = fit_hierarchical(table, settings, ModelSettings(sampler=sampler))
    seconds = time.perf_counter() - start
    posterior = tree["posterior"].to_dataset().drop_vars("outlier_probability")
    ess, of = worst(monitor(posterior).ess_bulk, largest=False)
    return {
        "records": table["record"].nunique(),
        "sampler": sampler_runs(tree)[-1].sampler,
        "seconds": seconds,
        "steps": float(tree["sample_stats"]["n_steps"].to_numpy().mean()),
        "divergences": sampler_runs(tree)[-1].divergences,
        "ess": ess,
        "of": of.split("[")[0],
        "peak": peak_mb(),
    }


def draw(rows: Sequence[Mapping[str, float]], path: Path) -> None:
    """Draw seconds over records, both logarithmic, with lines of time in proportion to the number."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for sampler in SIZES:
        points = sorted((row["records"], row["seconds"]) for row in rows if row["sampler"] == sampler)
        if points:
            axes.loglog(*zip(*points, strict=True), "o-", label=f"{sampler} sampler")
    records = np.array([min(row["records"] for row in rows), max(row["records"] for row in rows)])
    for each_s in (0.01, 0.1):
        axes.loglog(records, each_s * records, color="0.7", linewidth=0.8, zorder=0)
        axes.annotate(f"{each_s:g} s a record", (records[1], each_s * records[1]), ha="right", color="0.4")
    axes.set(xlabel="records (simulated)", ylabel="table to posterior, s")
    axes.legend()
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the table, a row a fit, and draw the figure if one is asked for."""
    drawn = "--figure" in sys.argv
    rows = [(size, sampler) for sampler, sizes in SIZES.items() for size in sizes] + [LARGEST] * drawn
    measured = []
    print(
        f"\nSimulated, {POINTS} points a record, {CHAINS} chains of {WARMUP} warmup and {DRAWS} draws, target "
        "acceptance 0.8; seconds from the table to the posterior, compilation included.\n\n"
        "| records | sampler | s | gradients a draw | divergences | worst bulk ESS | of | ESS a second | peak MB |\n"
        "|---|---|---|---|---|---|---|---|---|"
    )
    for size, sampler in sorted(rows)[: 2 if "--quick" in sys.argv[1:] else None]:
        command = [sys.executable, __file__, "--fit", str(size), sampler]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        row = json.loads(done.stdout.splitlines()[-1])
        measured.append(row)
        print(
            f"| {row['records']:,} | {row['sampler']} | {row['seconds']:.0f} | {row['steps']:.0f} "
            f"| {row['divergences']} | {row['ess']:.0f} | {row['of']} | {row['ess'] / row['seconds']:.1f} "
            f"| {row['peak']:.0f} |",
            flush=True,
        )
    if drawn:
        draw(measured, Path(sys.argv[sys.argv.index("--figure") + 1]))


if __name__ == "__main__":
    if "--fit" in sys.argv:
        print(json.dumps(measure(int(sys.argv[-2]), sys.argv[-1])))
    else:
        main()
