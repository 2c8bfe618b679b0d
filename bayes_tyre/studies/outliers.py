"""Error and coverage under discordant repeats: the posterior, the source's rule and the plain mean.

Half of the campaigns draw discordant repeats as the model does; in the others they are shifted by 20 to 40 %, like
records with a wrong pressure or fixture.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation
from bayes_tyre.studies.calibration import AT_ONCE, judge_sampling
from bayes_tyre.studies.design import START_MM, Design, outlier_design
from bayes_tyre.studies.design_fit import DesignFit
from bayes_tyre.studies.repeat_means import RULES, MeanEstimates, mean_of_repeats
from bayes_tyre.studies.truths import Truths, simulate_forces
from bayes_tyre.studies.uniformity import share_interval

#: Shares of discordant repeats.
SHARES = (0.0, 0.05, 0.15)
#: How a discordant repeat differs: by factors exp(N(0, 6 sd)), or one way by 20 to 40 %. They alternate.
KINDS = ("scattered", "shifted")
#: Standard deviations of the logarithm: of ordinary repeats about their case, and of cases about their group mean.
SD_REPEAT, SD_CASE = {"k": 0.04, "beta": 0.10}, {"k": 0.08, "beta": 0.30}
TYPICAL = {"k": 1.7, "beta": 0.1}
POSTERIOR = "posterior"
_WIDER, _SHIFT = 6.0, (0.2, 0.4)
_J_KN, _NOISE_KN = 1.0, 0.02


class Outliers(NamedTuple):
    """Result of the study.

    Attributes
    ----------
    table:
        A row a share, kind, group of cases, parameter and method: `rmse` (relative), `rmse_se`, `coverage` of 95 %
        intervals with `coverage_lower` and `coverage_upper`, `half_width` (relative, median), `cases`.
    datasets:
        A row a campaign, as `judge_sampling` gives it, with its share and kind.
    """

    table: pd.DataFrame
    datasets: pd.DataFrame


def study_outliers(
    campaigns: int = 200,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda _: None,
    *,
    fit: DesignFit | None = None,
) -> Outliers:
    """Return error and coverage of case k and beta by method, over campaigns with ever more discordant repeats.

    Parameters
    ----------
    campaigns:
        Number of campaigns with each share of discordant repeats; the kinds alternate.
    seed:
        Of campaigns and sampler.
    on_progress:
        Called with the number of campaigns just fitted.
    fit:
        Compiled already.
    """
    fit = fit or DesignFit(outlier_design(), nominal_start=False)
    estimates, judged = [], []
    for s, share in enumerate(SHARES):
        rng = np.random.default_rng((seed, s))
        for first in range(0, campaigns, AT_ONCE):
            kinds = np.array([KINDS[i % 2] for i in range(first, min(first + AT_ONCE, campaigns))])
            truths = draw_campaigns(fit.design, share, kinds, rng)
            force = simulate_forces(fit.design, truths, rng)
            approximations = fit.approximations(force)
            sampled = fit.sample(force, approximations, int(rng.integers(2**31)), on_progress)
            judged.append(judge_sampling(sampled, first).assign(share=share, kind=kinds))
            estimates.append(_estimates(fit.design, approximations, sampled.draws, truths).assign(share=share))
            estimates[-1]["campaign"] += first
            estimates[-1]["kind"] = kinds[estimates[-1]["campaign"] - first]
    return Outliers(compare(pd.concat(estimates, ignore_index=True)), pd.concat(judged, ignore_index=True))


def draw_campaigns(design: Design, share: float, kinds: np.ndarray, rng: np.random.Generator) -> Truths:
    """Return truths of campaigns, one for each of `kinds`, in which each repeat is discordant with this probability."""
    sets, (record, records) = len(kinds), (design.factors.of_record, len(design.factors.of_record))
    truths: Truths = {"discordant": rng.random((sets, records)) < share}
    for name, typical in TYPICAL.items():
        case = typical * np.exp(SD_CASE[name] * rng.standard_normal((sets, len(design.factors.cases))))
        ordinary = np.exp(SD_REPEAT[name] * rng.standard_normal((sets, records)))
        scattered = np.exp(_WIDER * SD_REPEAT[name] * rng.standard_normal((sets, records)))
        shifted = 1.0 + rng.choice([-1.0, 1.0], (sets, records)) * rng.uniform(*_SHIFT, (sets, records))
        discordant = np.where(kinds[:, None] == "scattered", scattered, shifted * ordinary)
        truths[f"{name}_case"] = case
        truths[name] = case[:, record] * np.where(truths["discordant"], discordant, ordinary)
    way = np.sign(design.factor_table["step_kN"].to_numpy(dtype=float))
    truths["J"] = way * _J_KN * np.exp(0.1 * rng.standard_normal((sets, records)))
    truths["F_i"] = design.start_kN + 0.1 * rng.standard_normal((sets, records))
    truths["C"] = truths["F_i"] + truths["J"] - truths["k"] * START_MM
    truths["sigma"] = np.full((sets, records), _NOISE_KN)
    return truths


def _estimates(
    design: Design, approximations: list[LaplaceApproximation], draws: dict[str, np.ndarray], truths: Truths
) -> pd.DataFrame:
    """Return each method's error and coverage: a row a campaign, case, parameter and method."""
    three = truths["discordant"].shape[0], len(design.factors.cases), 3
    has_discordant = truths["discordant"].reshape(three).any(axis=2)
    centres, tables = np.stack([np.asarray(each.records.centre) for each in approximations]), []
    for name, column in (("k", 2), ("beta", 3)):
        repeats = np.exp(centres[:, :, column]).reshape(three)
        by_method = {rule: mean_of_repeats(repeats, name, rule) for rule in RULES}
        by_method[POSTERIOR] = _posterior(draws[f"{name}_case"])
        tables += [
            _rows(estimates, truths[f"{name}_case"], has_discordant, name, method)
            for method, estimates in by_method.items()
        ]
    return pd.concat(tables, ignore_index=True)


def _posterior(draws: Float[np.ndarray, "sets draws cases"]) -> MeanEstimates:
    # Between two draws, so that the interval holds exactly 95 % with 39, 79, 119, ... of them.
    lower, median, upper = np.quantile(draws, [0.025, 0.5, 0.975], axis=1, method="weibull")
    return MeanEstimates(median, lower, upper)


def _rows(
    estimates: MeanEstimates,
    true: Float[np.ndarray, "sets cases"],
    has_discordant: Bool[np.ndarray, "sets cases"],
    parameter: str,
    method: str,
) -> pd.DataFrame:
    covered = (estimates.lower <= true) & (true <= estimates.upper)
    columns = {
        "campaign": np.repeat(np.arange(len(true)), true.shape[1]),
        "has_discordant": has_discordant.ravel(),
        "error": (estimates.value / true - 1.0).ravel(),
        "covered": covered.ravel(),
        "half_width": (0.5 * (estimates.upper - estimates.lower) / true).ravel(),
    }
    return pd.DataFrame(columns).assign(parameter=parameter, method=method)


def compare(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return error and coverage by share, kind, cases, parameter and method.

    Cases of one campaign share hyperparameters, so the standard error of `rmse` is from campaign to campaign; the
    interval of `coverage` counts cases as independent.
    """
    every = [
        estimates.assign(group="all cases"),
        estimates[estimates["has_discordant"]].assign(group="with a discordant repeat"),
    ]
    keys = ["share", "kind", "group", "parameter", "method"]
    rows = []
    for key, cases in pd.concat(every, ignore_index=True).groupby(keys, sort=False):
        squares = (cases["error"] ** 2).groupby(cases["campaign"]).agg(["sum", "size"])
        rmse = float(np.sqrt(squares["sum"].sum() / squares["size"].sum()))
        # Delta method on the mean of squares, a ratio of sums over campaigns.
        excess = squares["sum"] - rmse**2 * squares["size"]
        se = float(np.sqrt((excess**2).sum()) / squares["size"].sum() / (2.0 * rmse))
        inside, size = int(cases["covered"].sum()), len(cases)
        lower, upper = share_interval(inside, size)
        row = dict(zip(keys, key, strict=True)) | {"cases": size, "rmse": rmse, "rmse_se": se}
        row |= {"coverage": inside / size, "coverage_lower": lower, "coverage_upper": upper}
        rows.append(row | {"half_width": float(cases["half_width"].median())})
    return pd.DataFrame(rows)


def overview_lines(table: pd.DataFrame) -> list[str]:
    """Return lines that show the errors and coverage on all cases, both kinds taken together: a table a parameter."""
    everywhere = table[table["group"] == "all cases"]
    lines = []
    for parameter, of_parameter in everywhere.groupby("parameter", sort=False):
        cells = {
            f"{100 * float(str(key[0])):.0f} %": _cells(rows)
            for key, rows in of_parameter.groupby(["share"], sort=False)
        }
        lines += [
            f"{parameter} of a case: relative error (coverage of 95 % intervals), by share of discordant repeats",
            *pd.DataFrame(cells).to_string(justify="right").splitlines(),
        ]
    return lines


def _cells(rows: pd.DataFrame) -> dict[object, str]:
    """Return error and coverage of each method."""
    cells = {}
    for method, group in rows.groupby("method", sort=False):
        rmse = np.sqrt(np.average(group["rmse"] ** 2, weights=group["cases"]))
        coverage = np.average(group["coverage"], weights=group["cases"])
        cells[method] = f"{100 * rmse:.1f} % ({100 * coverage:.0f} %)"
    return cells
