"""Two results against each other: ratios of the cases that both have, from posteriors that know nothing of each other.

A configuration of one is set against the same one of the other, or, where they share none, against each of the other's.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.sampling.datatree import case_parameters, tree_cases
from bayes_tyre.record import CASE_FACTORS, ENERGY
from bayes_tyre.report.answer.formatting import label
from bayes_tyre.report.answer.ratios import SAME_CASE, Ratio, ratio_of
from bayes_tyre.results.contrasts import contrasts
from bayes_tyre.results.provenance import share_records

#: Why two results may have no ratio.
SAME_RECORDS = (
    "{first} and {other} are fits of the same records: they are not independent, and no ratio of the two is given; "
    "bayes-tyre compare says which of them predicts better."
)
SAME_TABLES = (
    "{first} and {other} rest on the same printed tables, one of them by way of records made from those: they are not "
    "independent, and no ratio of the two is given."
)
NO_CASES = "{first} and {other} have no test case in common: no ratio of the two is given."


class Comparison(NamedTuple):
    """Averaged ratios of two results by parameter, or a sentence on why there are none."""

    ratios: Mapping[str, Sequence[Ratio]]
    limitation: str = ""


class ComparedResult(NamedTuple):
    """One of the results: name, posterior (None where it has none by case), what its `run.json` holds."""

    name: str
    tree: xr.DataTree | None
    run: Mapping[str, Any]


def compare_results(first: ComparedResult, other: ComparedResult, interval: float) -> Comparison:
    """Return the ratios of the first result over the other, averaged over the cases that both have.

    Draws of the two are paired at random, by a fixed seed: their posteriors are independent, whatever their seeds.
    """
    names = {"first": label(first.name), "other": label(other.name)}
    if share_records(first.run, other.run):
        return Comparison({}, SAME_RECORDS.format(**names))
    if {first.run["origin"], other.run["origin"]} == {"published", "reconstructed"}:
        return Comparison({}, SAME_TABLES.format(**names))
    if first.tree is None or other.tree is None:
        return Comparison({}, NO_CASES.format(**names))
    shared = _shared(first.tree, other.tree)
    one, two = (_flat(tree, shared, seed) for seed, tree in enumerate((first.tree, other.tree)))
    draws = min(one.sizes["draw"], two.sizes["draw"])
    mine, theirs = ({case.configuration for case in tree_cases(each)} for each in (one, two))
    pairs = [(c, c) for c in sorted(mine & theirs)] or list(product(sorted(mine), sorted(theirs)))
    ratios: dict[str, list[Ratio]] = {}
    for above, below in pairs:
        both = xr.concat(
            [_only(one, above, "0").isel(draw=slice(draws)), _only(two, below, "1").isel(draw=slice(draws))], "case"
        )
        for _, row in _averages(both, interval).iterrows():
            named = _named(above, first), _named(below, other)
            ratios.setdefault(str(row["parameter"]), []).append(ratio_of(*named, row))
    return Comparison(ratios) if ratios else Comparison({}, NO_CASES.format(**names))


def _named(configuration: str, result: ComparedResult) -> str:
    return f"{configuration} ({result.name})" if configuration else result.name


def has_cases(tree: xr.DataTree) -> bool:
    """Return whether a posterior has parameters of cases: k at least, beta only where its law has one."""
    return "posterior" in tree.children and "k_case" in tree["posterior"]


def _shared(first: xr.DataTree, other: xr.DataTree) -> list[str]:
    """Return the parameters that the cases of both have; energies of different strokes are not the same parameter."""
    mine, theirs = (case_parameters(tree["posterior"].to_dataset()) for tree in (first, other))
    same_stroke = first.attrs.get("amplitude_mm") == other.attrs.get("amplitude_mm")
    return [name for name in mine if name in theirs and (same_stroke or name != ENERGY)]


def _flat(tree: xr.DataTree, parameters: Sequence[str], seed: int) -> xr.Dataset:
    """Return the draws of the cases as one chain, in random order."""
    posterior = tree["posterior"].to_dataset()
    of_cases = posterior[[f"{name}_case" for name in parameters]].drop_vars("case")
    flat = of_cases.stack(sample=("chain", "draw")).transpose("case", "sample")
    order = np.random.default_rng(seed).permutation(flat.sizes["sample"])
    plain = flat.drop_vars(["sample", "chain", "draw"]).isel(sample=order).rename(sample="draw")
    coordinates = {f"case_{factor}": ("case", posterior[f"case_{factor}"].to_numpy()) for factor in CASE_FACTORS}
    return plain.expand_dims("chain").transpose("chain", "draw", "case").assign_coords(coordinates)


def _only(cases: xr.Dataset, configuration: str, name: str) -> xr.Dataset:
    """Return the cases of one configuration, which is called by another name."""
    labels = [case.configuration for case in tree_cases(cases)]
    mine = cases.isel(case=[i for i, name in enumerate(labels) if name == configuration])
    return mine.assign_coords(case_configuration=("case", np.full(mine.sizes["case"], name, dtype=object)))


def _averages(both: xr.Dataset, interval: float) -> pd.DataFrame:
    tree = xr.DataTree.from_dict({"posterior": both})
    tree.attrs["origin"] = ""
    rows = contrasts(tree, "", interval)
    # The average over all matched cases comes first, and stays where their factors are missing.
    return rows[rows["matching"] == SAME_CASE].drop_duplicates("parameter")
