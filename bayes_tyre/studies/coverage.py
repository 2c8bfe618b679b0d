"""Coverage of the intervals of `fit` by kind of data, of all data sets and of those whose verdict is `pass`."""

import time
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.judge import judge
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_prepared, joint_chains
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import LONGEST, SamplerSettings
from bayes_tyre.record import RECORD_UNITS, Case
from bayes_tyre.results.cases.untested import log_values_of_untested
from bayes_tyre.studies.coverage_data import CONTRAST, KINDS, Kind, simulate

INTERVALS = (0.5, 0.95)
#: By name, as in `posterior.nc`: the dimension of each quantity. Ratios are of the two configurations; what is untested
#: is predicted for the cases of a speed held out.
QUANTITIES = {
    **{"k": "record", "beta": "record", "k_case": "case", "beta_case": "case"},
    **{"k_ratio": "contrast", "beta_ratio": "contrast"},
    **{"k_untested": "untested", "beta_untested": "untested"},
}
_KEYS = ["kind", "settings"]
_BETWEEN = "; "
#: Tells the random numbers of the sampler from those of the data.
_OF_SAMPLER = 1


class CoverageFit:
    """The fit and verdict of `fit` on many data sets: chains are compiled once for all of one design and model.

    Sensitivities to priors, which only notes of a verdict rest on, are left out: they take longer than the sampling.
    So few records are sampled jointly, as `fit` does.
    """

    def __init__(self, sampler: SamplerSettings | None = None) -> None:
        self.sampler = sampler or SamplerSettings(longest=LONGEST)
        self._chains: dict[object, Chains] = {}

    def decides(self, name: str, seed: int, number: int) -> dict[str, object]:
        """Return what determines the estimates of a data set beside the package's version, ready for JSON."""
        sampler = [self.sampler.chains, self.sampler.warmup, self.sampler.draws]
        return {"kind": asdict(KINDS[name]), "name": name, "seed": seed, "set": number, "sampler": sampler}

    def estimate(self, name: str, seed: int, number: int) -> pd.DataFrame:
        """Return the intervals of a data set of a kind in `KINDS`, beside the truth.

        Returns
        -------
        pandas.DataFrame
            A row a quantity and element: `truth, median, lower_50, upper_50, lower_95, upper_95` (kN/mm or mm); of the
            data set `verdict`, `failed_checks` and `seconds`.
        """
        kind, began = KINDS[name], time.monotonic()
        table, truth = simulate(kind, seed, number)
        model = ModelSettings(**kind.options)
        records = prepare_records(table, model)
        sampler = replace(self.sampler, seed=seed_of_set(seed, number))
        tree = fit_prepared(records, sampler, model, self._compiled(kind, records, model))
        tree, diagnostics = judge(tree, lambda tree, _: tree, Attempts(), table)
        held_out = truth["speed_km_h"] == kind.held_out_km_h
        posterior = with_ratios(tree["posterior"].to_dataset(), truth)
        if held_out.any():
            posterior = with_untested(posterior, model.priors, truth[held_out], seed=number)
        rows = intervals(posterior, truth)
        rows.insert(0, "kind", name)
        rows.insert(1, "settings", kind.settings)
        rows.insert(2, "set", number)
        took = time.monotonic() - began
        return rows.assign(
            verdict=diagnostics.verdict, failed_checks=_failed(diagnostics), seconds=took, origin="simulated"
        )

    def _compiled(self, kind: Kind, records: PreparedRecords, model: ModelSettings) -> Chains:
        key = *records.batch.records, kind.points + kind.rest_points, kind.settings
        if key not in self._chains:
            self._chains[key] = joint_chains(records, self.sampler, model)
        return self._chains[key]


def seed_of_set(seed: int, number: int) -> int:
    """Return the seed of the sampler for a data set of a study: errors of the draws are then not alike in all sets."""
    return int(np.random.default_rng([seed, number, _OF_SAMPLER]).integers(2**31))


def with_ratios(posterior: xr.Dataset, truth: pd.DataFrame) -> xr.Dataset:
    """Return the posterior with the mean ratios of k and beta, dual over single, dim contrast: all cases match."""
    of_case = truth.drop_duplicates("case").set_index("case")["configuration"]
    dual = (of_case[posterior["case"].to_numpy().astype(str)] == "dual").to_numpy()
    ratios = {}
    for parameter in ("k", "beta"):
        of_cases = posterior[f"{parameter}_case"]
        values = of_cases.copy(data=np.log(of_cases.to_numpy()))
        log_ratio = values.isel(case=dual).mean("case") - values.isel(case=~dual).mean("case")
        ratio = log_ratio.expand_dims(contrast=[CONTRAST], axis=-1)
        ratios[f"{parameter}_ratio"] = ratio.copy(data=np.exp(ratio.to_numpy()))
    return posterior.assign(ratios)


def with_untested(posterior: xr.Dataset, priors: Priors, held_out: pd.DataFrame, seed: int) -> xr.Dataset:
    """Return the posterior with what it predicts of the k and beta of cases held out, given by their records."""
    rows = held_out.drop_duplicates("case")
    new, rng = [Case(*row) for row in rows[list(Case._fields)].itertuples(index=False)], np.random.default_rng(seed)
    shape = posterior.sizes["chain"], posterior.sizes["draw"], len(new)
    predicted = {}
    for name in ("k", "beta"):
        draws = np.exp(log_values_of_untested(posterior, priors, name, new, rng)).reshape(shape)
        predicted[f"{name}_untested"] = (("chain", "draw", "untested"), draws)
    return posterior.assign(predicted).assign_coords(untested=rows["case"].to_numpy())


def intervals(posterior: xr.Dataset, truth: pd.DataFrame) -> pd.DataFrame:
    """Return the median and the intervals of each record, case and ratio of a posterior, beside the truth by record."""
    levels = [0.5, *(side for share in INTERVALS for side in ((1.0 - share) / 2.0, (1.0 + share) / 2.0))]
    names = ["median", *(f"{side}_{100 * share:.0f}" for share in INTERVALS for side in ("lower", "upper"))]
    tables = []
    truth = truth.assign(untested=truth["case"], k_untested=truth["k_case"], beta_untested=truth["beta_case"])
    for quantity, dim in QUANTITIES.items():
        if quantity not in posterior:
            continue
        true = truth.drop_duplicates(dim).set_index(dim)[quantity]
        values = posterior[quantity].quantile(levels, ("chain", "draw"))
        elements = [str(label) for label in values[dim].to_numpy()]
        estimates = pd.DataFrame(values.transpose(dim, "quantile").to_numpy(), columns=names)
        unit = "1" if dim == "contrast" else RECORD_UNITS[quantity.partition("_")[0]]
        rows = pd.DataFrame({"quantity": quantity, "unit": unit}, estimates.index)
        tables.append(pd.concat([rows.assign(element=elements, truth=true[elements].to_numpy()), estimates], axis=1))
    return pd.concat(tables, ignore_index=True)


def _failed(diagnostics: Diagnostics) -> str:
    """Return the names of the checks that failed, without the element that some name."""
    names = (str(check["name"]).partition("[")[0] for check in diagnostics.checks if not check["passed"])
    return _BETWEEN.join(dict.fromkeys(names))


def coverage(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return coverage and bias by kind, quantity and interval.

    Returns
    -------
    pandas.DataFrame
        `kind, settings, quantity, interval, sets, sets_passed`; `coverage_passed, se_passed` of data sets whose verdict
        is ``pass``; `coverage_all, se_all` of all; `bias`, the median relative error of all.
    """
    rows = []
    for key, of_kind in estimates.groupby([*_KEYS, "quantity"], sort=False):
        passed = of_kind[of_kind["verdict"] == "pass"]
        error = of_kind["median"] / of_kind["truth"] - 1.0
        for share in INTERVALS:
            row = dict(zip([*_KEYS, "quantity"], key, strict=True)) | {"interval": share}
            row |= {"sets": of_kind["set"].nunique(), "sets_passed": passed["set"].nunique()}
            for name, chosen in (("passed", passed), ("all", of_kind)):
                row[f"coverage_{name}"], row[f"se_{name}"] = _covered(chosen, share)
            rows.append(row | {"bias": float(error.median()), "origin": "simulated"})
    return pd.DataFrame(rows)


def _covered(estimates: pd.DataFrame, share: float) -> tuple[float, float]:
    """Return the share of intervals that hold the truth, and its standard error over data sets.

    Intervals of one data set depend on each other: its count is the unit. Source: Cochran (1977), Sampling Techniques,
    3rd ed., section 3.12, the ratio of cluster totals.
    """
    truth = estimates["truth"]
    inside = (estimates[f"lower_{100 * share:.0f}"] <= truth) & (truth <= estimates[f"upper_{100 * share:.0f}"])
    counts = inside.groupby(estimates["set"]).agg(["sum", "size"])
    sets, total = len(counts), counts["size"].sum()
    if not sets:
        return np.nan, np.nan
    covered = float(counts["sum"].sum() / total)
    squares = float(((counts["sum"] - covered * counts["size"]) ** 2).sum())
    return covered, float(np.sqrt(squares * sets / (sets - 1)) / total) if sets > 1 else np.nan


def verdicts(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return by kind how many data sets there are, how many passed, how many failed each check; and seconds of one."""
    sets = estimates.drop_duplicates([*_KEYS, "set"])
    failed = sets["failed_checks"].str.split(_BETWEEN)
    names = dict.fromkeys(name for of_set in failed for name in of_set if name)
    counts = {name: failed.map(lambda of_set, name=name: name in of_set) for name in names}
    counted = sets.assign(sets=1, passed=sets["verdict"] == "pass", **counts)
    by_kind = counted.groupby(_KEYS, sort=False)[["sets", "passed", *counts]].sum().astype(int)
    by_kind.insert(2, "seconds", sets.groupby(_KEYS, sort=False)["seconds"].mean())
    return by_kind.reset_index().assign(origin="simulated")


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """Return the coverage of 95 % intervals of all data sets, and the bias of beta, as text, a row a kind."""
    rows = []
    for key, of_kind in table[table["interval"] == 0.95].set_index("quantity").groupby(_KEYS, sort=False):
        row = dict(zip(_KEYS, key, strict=True)) | {"pass": "{sets_passed} of {sets}".format_map(of_kind.iloc[0])}
        shares = zip(of_kind.index, of_kind["coverage_all"], of_kind["se_all"], strict=True)
        row |= {str(quantity): f"{share:.1%} ± {se:.1%}" for quantity, share, se in shares}
        rows.append(row | {"bias of beta": f"{of_kind.loc['beta', 'bias']:+.1%}"})
    return pd.DataFrame(rows).fillna("")  # kinds without a speed held out predict nothing
