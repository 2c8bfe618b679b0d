"""The posterior of the reconstructed campaign by four samplers: effective draws a second, and whether means agree.

Run ``python benchmarks/posterior_peers.py [--quick]``; prints Markdown. Same model, data and priors. Ours is the
compressed likelihood in its own coordinates; NumPyro, PyMC and nutpie (numba) get the direct likelihood in the form
that suits them best (`posterior_model`), and start from the least-squares estimates. 4 chains. Target acceptance: 0.8,
which is what each takes by itself, and ours as `fit` has it.
The rate is of the worst of bulk and tail ESS over every parameter of the records, the cases and the populations. End
to end: from the record table to the draws, all compilation included. Sampling alone: warmup and draws, compiled.
"""

import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import arviz as az
import numpy as np
import pandas as pd

CAMPAIGN = Path(__file__).parents[1] / "data/campaign/records.csv"
CHAINS, TARGET = 4, 0.8
#: Warmup and draws a chain; for --quick, on the single tyre's cases from the highest load alone.
FULL, QUICK = (500, 500), (150, 150)
#: Means that are farther apart, in units of their combined Monte Carlo error, are listed.
FAR = 4.0


class Run(NamedTuple):
    """Seconds end to end and of sampling alone, and draws by parameter, shape (chains, draws, ...)."""

    whole: float
    sampling: float
    draws: dict[str, np.ndarray]


class Summary(NamedTuple):
    """Means, their Monte Carlo errors, and the worst effective number of draws."""

    mean: dict[str, np.ndarray]
    error: dict[str, np.ndarray]
    ess: float
    worst: str


def ours(table: pd.DataFrame, warmup: int, draws: int) -> Run:
    """Return our run: sampling alone is from the first of its chunks of iterations to the last."""
    from bayes_tyre.inference.model.settings import ModelSettings
    from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
    from bayes_tyre.inference.sampling.run import SamplerSettings

    stamps: list[float] = []
    settings = SamplerSettings(CHAINS, warmup, draws, on_progress=lambda _: stamps.append(time.perf_counter()))
    began = time.perf_counter()
    tree = fit_hierarchical(table, settings, ModelSettings(noise="iid"))  # as the peers have it
    whole, posterior = time.perf_counter() - began, tree["posterior"].dataset
    draws_of = {str(name): array.to_numpy() for name, array in posterior.data_vars.items()}
    return Run(whole, stamps[-1] - stamps[0], draws_of)


def numpyro(table: pd.DataFrame, warmup: int, draws: int) -> Run:
    """Return NumPyro's run of the plain model."""
    import jax
    from numpyro.infer import MCMC, NUTS, init_to_value
    from posterior_model import data_of, numpyro_model

    began = time.perf_counter()
    data = data_of(table)
    kernel = NUTS(numpyro_model, init_strategy=init_to_value(values=data.starts), target_accept_prob=TARGET)
    mcmc = MCMC(kernel, num_warmup=warmup, num_samples=draws, num_chains=CHAINS, progress_bar=False)
    mcmc.run(jax.random.key(0), data=data)
    found = {name: np.asarray(value) for name, value in mcmc.get_samples(group_by_chain=True).items()}
    whole, began = time.perf_counter() - began, time.perf_counter()
    mcmc.run(jax.random.key(0), data=data)
    jax.block_until_ready(mcmc.get_samples())
    return Run(whole, time.perf_counter() - began, found)


def _arrays(tree: Any) -> dict[str, np.ndarray]:
    return {str(name): array.to_numpy() for name, array in tree["posterior"].dataset.data_vars.items()}


def pymc(table: pd.DataFrame, warmup: int, draws: int) -> Run:
    """Return the run of PyMC's own NUTS."""
    import pymc as pm
    from posterior_model import data_of, pymc_model

    began = time.perf_counter()
    with pymc_model(data_of(table)):
        tree = pm.sample(
            draws, tune=warmup, chains=CHAINS, cores=os.cpu_count(), mp_ctx="spawn", random_seed=0,
            init="adapt_diag", target_accept=TARGET, progressbar=False, compute_convergence_checks=False,
        )  # fmt: skip
    whole = time.perf_counter() - began
    return Run(whole, float(tree["posterior"].attrs["sampling_time"]), _arrays(tree))


def nutpie(table: pd.DataFrame, warmup: int, draws: int) -> Run:
    """Return nutpie's run, compiled by numba."""
    import nutpie
    from posterior_model import data_of, pymc_model

    began = time.perf_counter()
    compiled = nutpie.compile_pymc_model(pymc_model(data_of(table)), backend="numba", jitter_rvs=set())
    ready = time.perf_counter()
    tree = nutpie.sample(
        compiled, draws=draws, tune=warmup, chains=CHAINS, seed=0, target_accept=TARGET, progress_bar=False
    )
    done = time.perf_counter()
    return Run(done - began, done - ready, _arrays(tree))


RUNS: dict[str, Callable[[pd.DataFrame, int, int], Run]] = {
    "bayes_tyre": ours, "NumPyro, direct": numpyro, "PyMC": pymc, "nutpie, numba": nutpie,
}  # fmt: skip


def summary(draws: dict[str, np.ndarray]) -> Summary:
    """Return what a run says of each parameter."""
    tree = az.from_dict({"posterior": draws})
    bulk, tail = az.ess(tree, method="bulk"), az.ess(tree, method="tail", prob=(0.05, 0.95))
    error = az.mcse(tree, method="mean")
    least = {name: np.fmin(_of(bulk, name), _of(tail, name)).min() for name in draws}
    worst = min(least, key=lambda name: least[name])
    means = {name: array.mean(axis=(0, 1)) for name, array in draws.items()}
    return Summary(means, {name: _of(error, name) for name in draws}, float(least[worst]), worst)


def _of(tree: Any, name: str) -> np.ndarray:
    dataset = tree["posterior"] if "posterior" in getattr(tree, "children", {}) else tree
    return np.asarray(dataset[name])


def far_apart(one: Summary, other: Summary) -> tuple[list[str], float]:
    """Return the parameters whose means are too far apart, and the largest distance, in Monte Carlo errors."""
    said, largest = [], 0.0
    for name in one.mean:
        error = np.sqrt(one.error[name] ** 2 + other.error[name] ** 2)
        distance = np.atleast_1d(np.abs(one.mean[name] - other.mean[name]) / error)
        largest = max(largest, float(np.nanmax(distance)))
        said += [f"{name}[{i}] {distance.ravel()[i]:.1f}" for i in np.flatnonzero(distance.ravel() > FAR)]
    return said, largest


def main() -> None:
    """Run the samplers one after another and print what they cost and whether they agree."""
    from bayes_tyre.formats.tables.table_files import read_table
    from bayes_tyre.record_table import check_record_table
    from bayes_tyre.runtime import prepare_jax

    prepare_jax(CHAINS)
    import jax

    warnings.simplefilter("ignore")
    quick = "--quick" in sys.argv[1:]
    warmup, draws = QUICK if quick else FULL
    table = check_record_table(read_table(CAMPAIGN))
    if quick:
        few = (table["initial_load_kN"] == table["initial_load_kN"].max()) & (table["configuration"] == "single")
        table = table[few].reset_index(drop=True)
    found: dict[str, tuple[Run, Summary]] = {}
    with tempfile.TemporaryDirectory() as cache:
        jax.config.update("jax_compilation_cache_dir", cache)
        for name, run in RUNS.items():
            took = run(table, warmup, draws)
            shared = set.intersection(set(took.draws), *(set(done.draws) for done, _ in found.values()))
            if not found:
                # What the others do not have by this name is derived, and left out.
                shared -= {"outlier_probability"}
            found[name] = took, summary({parameter: took.draws[parameter] for parameter in sorted(shared)})
            print(f"{name}: {took.whole:.0f} s", file=sys.stderr, flush=True)
    said = f"{table['record'].nunique()} records, {CHAINS} chains of {warmup} warmup and {draws} draws"
    print(f"\n{said}; data reconstructed.\n")
    print("| | s end to end | s sampling | worst ESS | of | ESS a second, end to end | sampling | ours is faster by |")
    print("|---|---|---|---|---|---|---|---|")
    first, base = found["bayes_tyre"]
    for name, (run, told) in found.items():
        whole, alone = told.ess / run.whole, told.ess / run.sampling
        faster = f"{base.ess / first.whole / whole:.1f}, {base.ess / first.sampling / alone:.1f}"
        print(
            f"| {name} | {run.whole:.1f} | {run.sampling:.1f} | {told.ess:.0f} | {told.worst} | {whole:.2f} | "
            f"{alone:.2f} | {faster} |"
        )
    print()
    for name, (_, told) in found.items():
        if name != "bayes_tyre":
            far, largest = far_apart(told, base)
            count = sum(np.size(mean) for mean in told.mean.values())
            print(f"Means of {name} against ours: {len(far)} of {count} beyond {FAR:g} errors, largest {largest:.1f}.")
            print("".join(f"- {line}\n" for line in far))


if __name__ == "__main__":
    main()
