"""The posterior as tidy tables: every number of `summary.csv`, `cases.csv` and `repeats.csv` is computed here."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.diagnostics.convergence import ConvergenceStatistics, monitor, stored_statistics
from bayes_tyre.inference.diagnostics.course_checks import case_of_records
from bayes_tyre.inference.diagnostics.power_scaling import identified
from bayes_tyre.inference.model.hyperparameters import APART_REPEATS, JUDGEABLE_REPEATS
from bayes_tyre.inference.sampling.datatree import case_parameters, shown_parameters
from bayes_tyre.inference.sampling.group_means import named_group_means
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record import AXLE_PARAMETERS, CASE_FACTORS, ENERGY, FACTORS, LAW_PARAMETERS, RECORD_UNITS
from bayes_tyre.record_table import carry_extras
from bayes_tyre.results.equal_tailed import median_lower_upper

STATISTICS = ("mean", "sd", "median", "lower", "upper", "interval", "mcse_mean", "ess_bulk", "ess_tail", "r_hat")
#: Parameters of a record that `repeats.csv` shows, those of them that a posterior has.
REPEAT_PARAMETERS = (*LAW_PARAMETERS, "J", "C", "sigma", *AXLE_PARAMETERS, ENERGY)
#: Elements whose statistics are computed at once.
_BATCH = 256


def describe(
    draws: xr.DataArray, interval: float = 0.95, statistics: ConvergenceStatistics | None = None
) -> pd.DataFrame:
    """Return the statistics of each element, a row each in C order, columns `STATISTICS`.

    Parameters
    ----------
    draws:
        With dims chain and draw.
    interval:
        Probability inside `lower` and `upper`, equal-tailed.
    statistics:
        Its convergence statistics, where they are known already.
    """
    sample = draws.transpose("chain", "draw", ...)
    flat = sample.to_numpy().reshape(-1, int(np.prod(sample.shape[2:])))
    # In batches: quantiles copy the draws, which of thousands of records are gigabytes.
    batches = np.array_split(flat, max(1, -(-flat.shape[1] // _BATCH)), axis=1)
    mean, sd, median, lower, upper = np.concatenate(
        [[one.mean(axis=0), one.std(axis=0, ddof=1), *median_lower_upper(one, interval)] for one in batches], axis=1
    )
    statistics = statistics or monitor(sample.to_dataset(name="quantity"))
    r_hat = xr.full_like(statistics.ess_bulk, np.nan) if statistics.r_hat is None else statistics.r_hat
    monitored = {
        "mcse_mean": statistics.mcse_mean,
        "ess_bulk": statistics.ess_bulk,
        "ess_tail": statistics.ess_tail,
        "r_hat": r_hat,
    }
    return pd.DataFrame(
        {
            **{"mean": mean, "sd": sd, "median": median},
            **{"lower": lower, "upper": upper, "interval": interval},
            **{name: statistic.to_dataarray().to_numpy().ravel() for name, statistic in monitored.items()},
        }
    )


def _factors_of(posterior: xr.Dataset, dim: str) -> pd.DataFrame:
    """Return the factors along a dimension, a row an element; a factor that the data did not have is missing."""
    columns = {
        factor: posterior[f"{dim}_{factor}"].to_numpy() for factor in FACTORS if f"{dim}_{factor}" in posterior.coords
    }
    table = pd.DataFrame(columns, columns=list(FACTORS), index=range(posterior.sizes[dim]))
    if dim == "record":
        table.insert(0, "record", posterior["record"].to_numpy())
    return table


def cases(tree: xr.DataTree, verdict: str, interval: float = 0.95) -> pd.DataFrame:
    """Return `cases.csv`: k (kN/mm), beta (mm) and what else a case has, a row a case and parameter.

    `apart_probability` is the probability that the case stands apart from the others in this parameter: that they say
    little of it. It is missing for cases of one repeat, which may be discordant instead, and where the model has no
    such cases.
    """
    posterior = tree["posterior"].to_dataset()
    factors = _factors_of(posterior, "case")[list(CASE_FACTORS)]
    blocks = [
        _block(tree, factors, parameter, posterior[f"{parameter}_case"], RECORD_UNITS[parameter], interval).assign(
            apart_probability=apart_probability(tree, parameter).to_numpy()
        )
        for parameter in case_parameters(posterior)
    ]
    return _finish(blocks, tree, verdict)


def apart_probability(tree: xr.DataTree, parameter: str) -> pd.Series:
    """Return the posterior probability that each case stands apart in a parameter; missing where the model has none."""
    posterior = tree["posterior"].to_dataset()
    name = f"{parameter}_apart_probability"
    if name not in posterior:
        return pd.Series(np.nan, index=range(posterior.sizes["case"]))
    probability = pd.Series(posterior[name].mean(("chain", "draw")).to_numpy())
    return probability.where(np.bincount(case_of_records(posterior), minlength=len(probability)) >= APART_REPEATS)


def repeats(
    tree: xr.DataTree, verdict: str, interval: float = 0.95, extras: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Return `repeats.csv`: the parameters of each record, and the probability that it is discordant.

    `extras` is what further columns say of each record, such as a pressure
    (`bayes_tyre.record_table.record_extras`); they are carried through.

    `outlier_probability` is missing for records of cases with fewer than three repeats: two that differ cannot
    say which of them is discordant. Without records (a posterior of printed tables) the table has no rows.
    """
    posterior = tree["posterior"].to_dataset()
    if "record" not in posterior.dims:
        columns = ["record", *FACTORS, "parameter", "unit", *STATISTICS, "outlier_probability", "origin", "verdict"]
        return pd.DataFrame(columns=columns)
    factors = _factors_of(posterior, "record")
    outlier = outlier_probability(tree).to_numpy()
    blocks = [
        _block(tree, factors, name, posterior[name], RECORD_UNITS[name], interval).assign(outlier_probability=outlier)
        for name in shown_parameters(posterior, REPEAT_PARAMETERS)
    ]
    if extras is not None:
        blocks = [carry_extras(block, extras) for block in blocks]
    return _finish(blocks, tree, verdict)


def outlier_probability(tree: xr.DataTree) -> pd.Series:
    """Return the posterior probability that each record is discordant; missing where it cannot be judged."""
    posterior = with_records(tree)
    factors = _factors_of(posterior, "record")
    if "outlier_probability" not in posterior:
        return pd.Series(np.nan, index=factors.index)
    probability = pd.Series(posterior["outlier_probability"].mean(("chain", "draw")).to_numpy())
    of_case = factors.groupby(list(CASE_FACTORS), dropna=False)["record"].transform("size")
    return probability.where(of_case >= JUDGEABLE_REPEATS)


def judged_records(tree: xr.DataTree) -> pd.DataFrame:
    """Return `record`, the factors and `outlier_probability` of each record; no rows without records."""
    posterior = tree["posterior"].to_dataset()
    if "record" not in posterior.dims:
        return pd.DataFrame(columns=["record", *FACTORS, "outlier_probability"])
    return _factors_of(posterior, "record").assign(outlier_probability=outlier_probability(tree))


def summary(tree: xr.DataTree, verdict: str, interval: float = 0.95) -> pd.DataFrame:
    """Return `summary.csv`: a row a scalar, sampled or derived.

    A row carries the factors that name it; an effect of a speed, load, step or group has its level in the name,
    such as ``log_k_speed[25]``. `k_mean` and `beta_mean` are the means over the cases of `group_means`.

    `contraction`, `prior_sensitivity`, `likelihood_sensitivity` and `decided_by` say what decides each
    (`bayes_tyre.inference.diagnostics.power_scaling`); empty where that is not known.
    """
    posterior = tree["posterior"].to_dataset()
    blocks = []
    for name, draws in named_group_means(tree).data_vars.items():
        factors = pd.DataFrame({factor: draws[factor].to_numpy() for factor in CASE_FACTORS[:2]})
        unit = RECORD_UNITS[str(name).removesuffix("_mean")]
        blocks.append(_identified(_block(tree, factors, str(name), draws, unit, interval), tree))
    for name, draws in posterior.data_vars.items():
        unit = "" if draws.attrs["units"] == "1" else draws.attrs["units"]
        dims = [str(dim) for dim in draws.dims if dim not in ("chain", "draw")]
        if dims and dims[0] in ("case", "record"):
            factors = _factors_of(posterior, dims[0])
            blocks.append(_identified(_block(tree, factors, str(name), draws, unit, interval), tree))
            continue
        labels = [_level(label) for label in draws[dims[0]].to_numpy()] if dims else [""]
        block = _block(tree, pd.DataFrame(index=range(len(labels))), str(name), draws, unit, interval)
        block = _identified(block, tree)
        blocks.append(block.assign(parameter=[f"{name}[{label}]" if label else str(name) for label in labels]))
    return _finish(blocks, tree, verdict, ["record", *FACTORS])


def _level(label: object) -> str:
    return f"{label:g}" if isinstance(label, float) else str(label)


def _block(
    tree: xr.DataTree, factors: pd.DataFrame, parameter: str, draws: xr.DataArray, unit: str, interval: float
) -> pd.DataFrame:
    described = describe(draws, interval, stored_statistics(tree, str(draws.name)))
    return pd.concat([factors.reset_index(drop=True).assign(parameter=parameter, unit=unit), described], axis=1)


def _identified(block: pd.DataFrame, tree: xr.DataTree) -> pd.DataFrame:
    """Return the rows of one quantity with what decides each."""
    decided = identified(tree, str(block["parameter"].iloc[0]))
    decided = decided if len(decided) == len(block) else decided.loc[[0] * len(block)].reset_index(drop=True)
    return pd.concat([block, decided], axis=1)


def _finish(
    blocks: list[pd.DataFrame], tree: xr.DataTree, verdict: str, factors: list[str] | None = None
) -> pd.DataFrame:
    """Return the blocks as one table: factors first, the verdict last."""
    table = pd.concat(blocks, ignore_index=True).assign(origin=tree.attrs["origin"], verdict=verdict)
    if factors is None:
        return table
    rest = [column for column in table.columns if column not in factors]
    return table.reindex(columns=[*factors, *rest])
