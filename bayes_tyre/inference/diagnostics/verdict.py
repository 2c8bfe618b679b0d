"""The verdict: whether a posterior may be trusted, and if not, which parameter says so and what to do."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from bayes_tyre.inference.diagnostics.attempts import MODEL_CHECKS, checks_in
from bayes_tyre.inference.diagnostics.convergence import by_chain, by_parameter, statistics_of
from bayes_tyre.inference.diagnostics.data_checks import decided_by_given_priors, failed_checks, find_limitations
from bayes_tyre.inference.diagnostics.sampling_checks import (
    Check,
    sampling_checks,
    uncertain_probabilities,
    without_probabilities,
)
from bayes_tyre.inference.sampling.datatree import priors_of


class Diagnostics(NamedTuple):
    """What `diagnostics.json` holds.

    Attributes
    ----------
    verdict:
        ``pass`` or ``fail``.
    reasons:
        One sentence each: the parameter or the chain, the value, and what to do.
    r_hat_max, ess_bulk_min, ess_tail_min, bfmi_min:
        The worst over all parameters (chains); NaN where they do not exist.
    residual_autocorrelation:
        Mean over records of the residuals' lag-1 autocorrelation; NaN without records.
    limitations:
        What a reader should know and that fails nothing, such as weakly identified quantities: one sentence each.
    by_parameter, by_chain:
        The statistics of each parameter and of each chain's sampler, as
        `bayes_tyre.inference.diagnostics.convergence` has them.
    checks:
        Every criterion of the verdict: `name`, `kind` (``sampling``, ``model``, ``data``), `passed`, `value`, `limit`,
        `where`, `remedy`, as `bayes_tyre.inference.diagnostics.sampling_checks.Check` has them.
    """

    verdict: str
    reasons: tuple[str, ...]
    r_hat_max: float
    ess_bulk_min: float
    ess_tail_min: float
    divergences: int
    bfmi_min: float
    draws: int
    chains: int
    residual_autocorrelation: float
    limitations: tuple[str, ...] = ()
    by_parameter: dict[str, dict[str, Any]] = {}  # noqa: RUF012  (a field of a named tuple, never changed)
    by_chain: list[dict[str, Any]] = []  # noqa: RUF012
    checks: list[dict[str, Any]] = []  # noqa: RUF012

    def __repr__(self) -> str:
        """Return verdict, reasons and limitations, a line each, and what else there is."""
        lines = [f"verdict: {self.verdict}", *(f"reason: {reason}" for reason in self.reasons)]
        lines += [f"limitation: {limitation}" for limitation in self.limitations]
        return "\n".join([*lines, f"also: {', '.join(name for name in self._fields if name not in _SHOWN)}"])


_SHOWN = ("verdict", "reasons", "limitations")
_RECORDS_SOUND = Check("records", "data", True, np.nan, np.nan, "", "", "")


def diagnose(tree: xr.DataTree) -> Diagnostics:
    """Return the verdict on a posterior, from every quantity it holds.

    Pass: R-hat <= 1.01, bulk and tail ESS >= 100 a chain, BFMI >= 0.3, no divergence, finite draws, no failed check
    of `bayes_tyre.inference.diagnostics.data_checks` on the records, and the checks of the model that the posterior
    carries (`bayes_tyre.inference.diagnostics.judge.model_checks`). Of an outlier probability neither R-hat nor ESS is
    judged: a Monte Carlo error of its mean above 0.02 is a limitation, for it makes no interval wrong.

    Source: Vehtari et al. (2021), "Rank-normalization, folding, and localization".

    Parameters
    ----------
    tree:
        A posterior as `bayes_tyre.inference.sampling.datatree.to_datatree` gives it.
    """
    posterior, priors = tree["posterior"].to_dataset(), priors_of(tree)
    statistics, sampler = without_probabilities(statistics_of(tree)), by_chain(tree)
    checks = [
        *sampling_checks(tree, statistics, sampler),
        *checks_in(tree, MODEL_CHECKS),
        *(failed_checks(posterior, priors) or [_RECORDS_SOUND]),
    ]
    reasons = tuple(check.reason for check in checks if not check.passed)
    value, draws = {check.name: check.value for check in checks}, posterior.sizes["draw"]
    return Diagnostics(
        "fail" if reasons else "pass",
        reasons,
        value["r_hat"],
        value["ess_bulk"],
        value["ess_tail"],
        int(value["divergences"]),
        value["bfmi"],
        draws,
        posterior.sizes["chain"],
        value.get("residual_autocorrelation", np.nan),
        (
            *(check.note for check in checks if check.kind == "model" and check.note),
            *uncertain_probabilities(posterior),
            *_deep_trees(sampler, draws),
            *decided_by_given_priors(posterior, priors),
            *_not_checked(checks),
            *find_limitations(tree),
        ),
        by_parameter(statistics),
        sampler,
        [check.row for check in checks],
    )


def _not_checked(checks: Sequence[Check]) -> Iterator[str]:
    """Yield which checks could not be made, a sentence for each reason."""
    for why in dict.fromkeys(check.not_checked for check in checks if check.not_checked):
        names = ", ".join(check.name for check in checks if check.not_checked == why)
        yield f"{names}: not checked: {why}"


def _deep_trees(sampler: list[dict[str, Any]], draws: int) -> Iterator[str]:
    for chain in sampler:
        if at_limit := chain.get("trees_at_limit"):
            yield (
                f"chain {chain['chain']}: {at_limit} of {draws} trees grew to their limit of depth "
                f"{chain['tree_depth_max']}: sampling was slow there; raise --warmup"
            )
