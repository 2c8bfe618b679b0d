"""Models compared by how they predict records that they have not seen: a table, and a sentence on what it means."""

from collections.abc import Mapping
from copy import copy

import arviz as az
import numpy as np
import pandas as pd
import xarray as xr
from arviz_stats import ELPDData

from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut

#: Differences below this many standard errors, or below so much log density, tell no model from another (Sivula,
#: Magnusson and Vehtari 2025, "Uncertainty in Bayesian leave-one-out cross-validation based model comparison").
STANDARD_ERRORS, LEAST_DIFFERENCE = 2.0, 4.0
#: What may be left out.
RECORD, CASE = "record", "case"


def compare(predicted: Mapping[str, LeaveOneOut], verdicts: Mapping[str, str], unit: str = RECORD) -> pd.DataFrame:
    """Return `comparison.csv`, or `comparison_cases.csv`: a row a model, the best first.

    Columns: `model, rank, elpd, se, elpd_difference, difference_se` (to the best; log density, dimensionless),
    `p_loo` (effective number of parameters), `weight` (stacking), `records` or `cases`, `pareto_k_max, refitted` (for
    how many of them the model was fitted again), `effective_points_min`, `refits_disagreeing` (in how many of
    these chains disagree), `refits_few_draws` (how many have too few effective draws), `verdict` (``fail`` where the
    posterior's is, or where the estimate cannot be trusted).

    Parameters
    ----------
    predicted, verdicts:
        By model: what it predicts of records, or cases, left out, and the verdict on its posterior.
    unit:
        What was left out: `RECORD` or `CASE`.
    """
    table = az.compare(_about_best(predicted), method="stacking", round_to="none")
    best, rows = str(table.index[0]), []
    for name, row in table.iterrows():
        each = predicted[str(name)]
        rows.append(
            {
                "model": name,
                "rank": int(row["rank"]) + 1,
                "elpd": float(each.elpd.elpd),
                "se": _standard_error(each.elpd.elpd_i),
                "elpd_difference": float(row["elpd_diff"]),
                "difference_se": _standard_error(each.elpd.elpd_i - predicted[best].elpd.elpd_i),
                "p_loo": float(row["p"]),
                "weight": float(row["weight"]),
                f"{unit}s": len(each.pareto_k),
                "pareto_k_max": float(each.pareto_k.max()),
                "refitted": int(each.refitted.sum()),
                "effective_points_min": float(each.effective_points.min()),
                "refits_disagreeing": int(each.disagreeing.sum()),
                "refits_few_draws": int(each.few_draws.sum()),
                "verdict": verdicts[str(name)] if each.trusted else "fail",
            }
        )
    return pd.DataFrame(rows)


def _standard_error(of_units: xr.DataArray) -> float:
    """Return the standard error of a sum over records or cases; ArviZ's of a difference has another divisor."""
    return float(np.sqrt(of_units.size * of_units.var(ddof=1)))


def _about_best(predicted: Mapping[str, LeaveOneOut]) -> dict[str, ELPDData]:
    """Return the records' log densities less the best model's of each: no difference and no weight changes.

    Stacking takes their exponentials, and of a whole recording the density has no floating-point number.
    """
    best = np.max([each.elpd.elpd_i.to_numpy() for each in predicted.values()], axis=0)
    shifted = {}
    for name, each in predicted.items():
        shifted[name] = copy(each.elpd)
        shifted[name].elpd_i = each.elpd.elpd_i - best
        shifted[name].elpd = float(shifted[name].elpd_i.sum())
    return shifted


def by_record(predicted: Mapping[str, LeaveOneOut]) -> pd.DataFrame:
    """Return a row a model and record: `model, record, elpd, pareto_k, refitted`."""
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "model": name,
                    "record": each.elpd.elpd_i["record"].to_numpy(),
                    "elpd": each.elpd.elpd_i.to_numpy(),
                    "pareto_k": each.pareto_k,
                    "refitted": each.refitted,
                }
            )
            for name, each in predicted.items()
        ],
        ignore_index=True,
    )


def sentence(table: pd.DataFrame) -> str:
    """Return what a comparison means: which model predicts best, and whether that is more than luck."""
    best, others = table.iloc[0], table.iloc[1:]
    unit = unit_of(table)
    difference = others["elpd_difference"].abs()
    tied = (difference < STANDARD_ERRORS * others["difference_se"]) | (difference < LEAST_DIFFERENCE)
    sentences = []
    if tied.any():
        sentences.append(
            f"{best['model']} predicts a {unit} left out best, but these {int(best[f'{unit}s'])} {unit}s cannot tell "
            f"it from {_listed(others[tied])}: take the simpler"
        )
    if not tied.all():
        sentences.append(
            f"{best['model']} predicts a {unit} left out better than {_listed(others[~tied])}, by more than chance"
        )
    return "; ".join(sentences) + "."


def rank_lines(table: pd.DataFrame) -> list[str]:
    """Return a line on what was left out, then a line a model: rank, name, elpd, difference from the best, weight."""
    unit = unit_of(table)
    return [
        f"{unit}s left out, one at a time:",
        *(
            f"{row.rank}  {row.model}  elpd {row.elpd:.1f} ± {row.se:.1f}  difference {row.elpd_difference:.1f} "
            f"± {row.difference_se:.1f}  weight {row.weight:.2f}  {row.verdict}"
            for row in table.itertuples()
        ),
    ]


def unit_of(table: pd.DataFrame) -> str:
    """Return what was left out in a table of `compare`: `RECORD` or `CASE`."""
    return CASE if f"{CASE}s" in table else RECORD


def _listed(models: pd.DataFrame) -> str:
    figures = zip(models["model"], models["elpd_difference"], models["difference_se"], strict=True)
    return ", ".join(f"{name} ({difference:.1f} ± {error:.1f})" for name, difference, error in figures)
