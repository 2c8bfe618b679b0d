"""The criteria of the verdict that judge the sampler: R-hat, ESS, Monte Carlo error, BFMI, divergences."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from bayes_tyre.inference.diagnostics.convergence import (
    ConvergenceStatistics,
    discordant_chain,
    monitor,
    where_divergent,
    worst,
)
from bayes_tyre.inference.diagnostics.divergences import against_divergences, longer_note, repeat_note
from bayes_tyre.inference.sampling.datatree import PROBABILITIES
from bayes_tyre.inference.sampling.effective_sizes import ESS_LEAST_PER_CHAIN, R_HAT_MOST
from bayes_tyre.inference.sampling.run import kept_acceptance, sampler_runs
from bayes_tyre.inference.sampling.summary_error import RECORD_SUMMARIES, SUMMARY_ERROR_MOST, SummaryError

BFMI_LEAST = 0.3
#: Largest Monte Carlo error of the mean of an outlier probability that goes unmentioned: a record below 0.44 or above
#: 0.56 is then on its side of 0.5 by three standard errors. Only the mean is reported: a tail that holds the few draws
#: away from 0 or 1 has a small ESS and a large R-hat where the mean is known to a thousandth. It fails no verdict: no
#: interval is wrong for it. The probability that a case stands apart is not mentioned at all: R-hat and ESS of the case
#: follow it.
PROBABILITY_ERROR_MOST = 0.02
_LISTED = " under by_parameter in diagnostics.json"
_MORE = "raise --warmup and --draws"


class Check(NamedTuple):
    """One criterion of the verdict.

    Attributes
    ----------
    name, kind:
        Such as ``r_hat``; ``sampling``, ``model`` or ``data``.
    passed:
        Whether it is met.
    value, limit:
        The worst value, and the last one that passes; NaN where there is no number.
    where:
        The element or chain of `value`; empty where it belongs to all.
    finding, remedy:
        What is wrong, and what to do: the sentence in `reasons` where it has failed.
    note:
        What a reader should know though it passed.
    not_checked:
        Why it could not be made, such as too few points; empty where it was. It then passes, without a value. One that
        was made of some records says here of which others it was not.
    """

    name: str
    kind: str
    passed: bool
    value: float
    limit: float
    where: str
    finding: str
    remedy: str
    note: str = ""
    not_checked: str = ""

    @property
    def reason(self) -> str:
        """The sentence in `reasons`."""
        return f"{self.finding}; {self.remedy}"

    @property
    def row(self) -> dict[str, Any]:
        """What `diagnostics.json` holds under `checks`: no finding; remedy where it failed, the last two if any."""
        row = self._asdict() | {"remedy": "" if self.passed else self.remedy}
        left_out = {"finding", *(name for name in ("note", "not_checked") if not row[name])}
        return {name: value for name, value in row.items() if name not in left_out}


def unchecked(name: str, limit: float, why: str) -> Check:
    """Return a check of the model that could not be made."""
    return Check(name, "model", True, np.nan, limit, "", "", "", not_checked=why)


def without_probabilities(statistics: ConvergenceStatistics) -> ConvergenceStatistics:
    """Return the convergence statistics of all quantities but `PROBABILITIES`, near 0 or 1 in most draws."""
    r_hat = None if statistics.r_hat is None else statistics.r_hat.drop_vars(PROBABILITIES, errors="ignore")
    return ConvergenceStatistics(
        r_hat, *(statistic.drop_vars(PROBABILITIES, errors="ignore") for statistic in statistics[1:])
    )


def sampling_checks(
    tree: xr.DataTree, statistics: ConvergenceStatistics, sampler: list[dict[str, Any]]
) -> Iterator[Check]:
    """Yield the checks of the sampler.

    Parameters
    ----------
    tree:
        A posterior as `bayes_tyre.inference.sampling.datatree.to_datatree` gives it.
    statistics, sampler:
        Its convergence statistics without those of `PROBABILITIES`, and `convergence.by_chain` of it.
    """
    posterior = tree["posterior"].to_dataset()
    yield _finite(posterior)
    yield _agreement(posterior, statistics)
    least = ESS_LEAST_PER_CHAIN * posterior.sizes["chain"]
    yield _enough("bulk", statistics.ess_bulk, least)
    yield _enough("tail", statistics.ess_tail, least)
    yield _energy(sampler)
    yield _divergences(tree, sampler)
    yield from _summaries(tree)


def mean_error(probability: xr.DataArray) -> xr.DataArray:
    """Return the Monte Carlo standard error of each mean; 0 where all draws are the same."""
    sample = ("chain", "draw")
    error = monitor(probability.to_dataset(name="probability")).mcse_mean["probability"]
    return error.where(probability.max(sample) != probability.min(sample), 0.0)


def uncertain_probabilities(posterior: xr.Dataset) -> Iterator[str]:
    """Yield which outlier probability is known too roughly to be quoted; no interval is wrong for that."""
    name, most = "outlier_probability", PROBABILITY_ERROR_MOST
    if name not in posterior:
        return
    errors = mean_error(posterior[name])
    value, where = worst(errors.to_dataset(name=name), largest=True)
    if value > most:
        others = _others(int((errors > most).sum()))
        yield f"{where}: Monte Carlo error {value:.3f} of its mean is above {most}{others}; raise --draws to quote it"


def _others(bad: int, where: str = "") -> str:
    return f" ({bad - 1} more{where})" if bad > 1 else ""


def _finite(posterior: xr.Dataset) -> Check:
    bad = [str(name) for name, draws in posterior.data_vars.items() if not np.isfinite(draws.to_numpy()).all()]
    where = ", ".join(bad)
    finding, remedy = f"{where}: draws are not finite", "check the scales of the records"
    return Check("finite_draws", "sampling", not bad, float(len(bad)), 0.0, where, finding, remedy)


def _agreement(posterior: xr.Dataset, statistics: ConvergenceStatistics) -> Check:
    if statistics.r_hat is None:
        finding, remedy = "one chain cannot be compared with another", "use --chains 4"
        return Check("r_hat", "sampling", False, np.nan, R_HAT_MOST, "", finding, remedy)
    value, where = worst(statistics.r_hat, largest=True)
    bad = sum(bool((statistic > R_HAT_MOST).any()) for statistic in statistics.r_hat.data_vars.values())
    chain = f"chain {discordant_chain(posterior, where)} most" if where else "all of them"
    finding = f"{where}: R-hat {value:.3f} is above {R_HAT_MOST}{_others(bad, _LISTED)}: chains disagree, {chain}"
    return Check("r_hat", "sampling", value <= R_HAT_MOST, value, R_HAT_MOST, where, finding, _MORE)


def _enough(kind: str, ess: xr.Dataset, least: int) -> Check:
    value, where = worst(ess, largest=False)
    bad = sum(bool((statistic < least).any()) for statistic in ess.data_vars.values())
    more = _others(bad, _LISTED)
    finding = f"{where}: {kind} ESS {value:.0f} is below {least}, {ESS_LEAST_PER_CHAIN} for each chain{more}"
    return Check(f"ess_{kind}", "sampling", value >= least, value, float(least), where, finding, _MORE)


def _energy(sampler: list[dict[str, Any]]) -> Check:
    stiff = sampler[int(np.argmin([chain["bfmi"] for chain in sampler]))]
    value, where = stiff["bfmi"], f"chain {stiff['chain']}"
    finding = f"energy: BFMI {value:.2f} of {where} is below {BFMI_LEAST}: tails are not explored"
    return Check("bfmi", "sampling", value >= BFMI_LEAST, value, BFMI_LEAST, where, finding, "raise --warmup")


def _divergences(tree: xr.DataTree, sampler: list[dict[str, Any]]) -> Check:
    divergent = [chain for chain in sampler if chain["divergences"]]
    total, where = sum(chain["divergences"] for chain in divergent), where_divergent(tree)
    each = ", ".join(f"{chain['divergences']} in chain {chain['chain']}" for chain in divergent)
    finding = (
        f"{total} divergent transitions ({each}{f'; most at {where}' if where else ''}): part of the posterior was "
        "not reached"
    )
    runs, remedy = sampler_runs(tree), against_divergences(kept_acceptance(tree))
    note = "; ".join(filter(None, (repeat_note(runs), longer_note(runs))))
    return Check("divergences", "sampling", not divergent, float(total), 0.0, where, finding, remedy, note)


def _summaries(tree: xr.DataTree) -> Iterator[Check]:
    """Yield whether the summaries that records were integrated out by are good enough, where they were tried."""
    if RECORD_SUMMARIES not in tree.attrs:
        return
    error = SummaryError.from_json(tree.attrs[RECORD_SUMMARIES])
    finding = f"{error.case}: summaries of the records put the log density off by {error.total:.2g}"
    joint = all(one.sampler == "joint" for one in sampler_runs(tree) if one.kept)
    note = f"{finding}: records were sampled as well (--sampler joint)" if joint else ""
    value, where = (0.0, "") if joint else (error.total, error.case)
    passed = joint or error.at_least <= SUMMARY_ERROR_MOST
    remedy = "use --sampler joint"
    yield Check("record_summaries", "sampling", passed, value, SUMMARY_ERROR_MOST, where, finding, remedy, note)
