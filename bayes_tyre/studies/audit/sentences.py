"""The audit's conclusion as sentences, made from its table: what simulation shows, not what a rig did."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from bayes_tyre.studies.audit.grid import CONFIGURATION, FACTOR_NAMES, FACTORS, INITIAL_LOAD_KN, SOURCE_WINDOW
from bayes_tyre.studies.audit.methods import AMPLITUDE_MM
from bayes_tyre.studies.audit.overview import (
    BetaResponse,
    at_source_window,
    beta_response,
    factor_effects,
    overview,
    ringing,
)

#: A method is insensitive to beta where less than this part of a true change of log beta is returned; it recovers beta
#: where a part in this range is returned, and the median size of the bias is below this, %.
INSENSITIVE, RECOVERS, RECOVERS_BIAS_PERCENT = 1 / 3, (0.8, 1.25), 20.0


def conclusion(table: pd.DataFrame, published_beta_mm: Sequence[float]) -> list[str]:
    """Return the conclusion, a paragraph a string.

    Parameters
    ----------
    table:
        `bayes_tyre.studies.audit.study.Audit.table`.
    published_beta_mm:
        The published betas, mm, to compare with what `thesis` returns.
    """
    methods = list(dict.fromkeys(table["method"]))
    paragraphs = [_what_was_done(table)]
    paragraphs += [_beta(table, method) for method in methods]
    paragraphs += [
        _factor_effects(table, "thesis"),
        _ringing(table, "thesis"),
        _published(beta_response(table, "thesis"), np.asarray(published_beta_mm)),
    ]
    summary = overview(table)
    paragraphs += [_errors(summary, parameter) for parameter in ("k", "beta", "x")]
    paragraphs += [_energy(summary), _declined(summary), _limits()]
    return [paragraph for paragraph in paragraphs if paragraph]


def _what_was_done(table: pd.DataFrame) -> str:
    ranges = []
    for name in FACTORS:
        levels = table[name].dropna().astype(float)
        if len(levels):
            label, unit = FACTOR_NAMES[name]
            ranges.append(f"{label} {_range(levels.min(), levels.max(), unit)}")
    rows = at_source_window(table)
    records = int((rows["returned"] + rows["declined"]).groupby([rows["method"], rows["parameter"]]).sum().max())
    return (
        f"In simulation: {records} records of a stationary axle ({CONFIGURATION} tyre, from "
        f"{INITIAL_LOAD_KN:g} kN) were simulated with {', '.join(ranges)}, and processed as if the truth were "
        "not known."
    )


def _outcome(response: BetaResponse) -> str:
    """Return `insensitive`, `partial` or `recovers`."""
    if not response.share >= INSENSITIVE:
        return "insensitive"
    recovers = RECOVERS[0] <= response.share <= RECOVERS[1] and response.bias_percent <= RECOVERS_BIAS_PERCENT
    return "recovers" if recovers else "partial"


_OUTCOMES = {
    "insensitive": "in simulation it says little about the tyre",
    "partial": "in simulation it follows the tyre, and is off all the same",
    "recovers": "in simulation it is a property of the tyre",
}


def _beta(table: pd.DataFrame, method: str) -> str:
    response = beta_response(table, method)
    if response is None:
        return f"beta by `{method}`: too few points returned one for a conclusion."
    smoothed = f" with the source's window of {SOURCE_WINDOW} samples" if method == "thesis" else ""
    returned, true = _range(*response.returned, "mm"), _range(*response.true, "mm")
    return (
        f"beta by `{method}`{smoothed}: {returned} is returned where the truth is {true} (medians of {response.points} "
        f"points, rank correlation {response.rank_correlation:.2f}; a true beta {response.span:.3g} times as large "
        f"comes back {response.span**response.share:.2g} times as large; half of the points are off by more than "
        f"{response.bias_percent:.2g} %): {_OUTCOMES[_outcome(response)]}."
    )


def _factor_effects(table: pd.DataFrame, method: str) -> str:
    effects = factor_effects(table, method)
    if len(effects) < 2 or "beta_mm" not in effects:
        return ""
    clauses = [
        f"{FACTOR_NAMES[name][0]} ({_range(effect.low, effect.high, FACTOR_NAMES[name][1])}) changes it by a factor of "
        f"{effect.ratio:.2g}"
        for name, effect in effects.items()
    ]
    most = max(effects, key=lambda name: effects[name].ratio)
    follows = (
        "the tyre moves it most"
        if most == "beta_mm"
        else f"the {FACTOR_NAMES[most][0]} moves it more than the tyre does"
    )
    return f"One thing changed and all else held, beta by `{method}` moves so: {'; '.join(clauses)}: {follows}."


def _ringing(table: pd.DataFrame, method: str) -> str:
    """Return how the axle's damping changes a method's result: the simulated axle may ring more than a rig's."""
    parts = []
    for parameter, unit in (("k", "kN/mm"), ("beta", "mm")):
        factors = ringing(table, method, parameter)
        if len(factors) < 2:
            return ""
        each = ", ".join(f"{value:.3g} {unit} at {ratio:g}" for ratio, value in factors.items())
        parts.append(f"{parameter} {each}")
    return (
        f"How much the axle rings is part of it: with the typical tyre and other damping ratios `{method}` returns "
        f"{'; '.join(parts)}."
    )


def _published(response: BetaResponse | None, published: np.ndarray) -> str:
    if response is None:
        return ""
    low, high = response.returned
    inside = int(np.sum((published >= low) & (published <= high)))
    text = (
        f"The published betas are {_range(published.min(), published.max(), 'mm')}; {inside} of {len(published)} lie "
        f"within the {_range(low, high, 'mm')} that `thesis` returns in simulation."
    )
    true = _range(*response.true, "mm")
    text += {
        "insensitive": f" What they can say is that records simulated with a true beta anywhere in {true} come "
        "back as such numbers. What they cannot say is which beta the tyre has, nor, with it, what energy it loses.",
        "partial": f" They can order tyres within {true} where load step and processing were the same; what they "
        "cannot give is the tyre's own beta in mm.",
        "recovers": f" They can be read as the tyre's beta within {true}, as far as its error above allows.",
    }[_outcome(response)]
    return f"{text} That is what simulation shows; it is no statement of what happened on the rig."


def _errors(summary: pd.DataFrame, parameter: str) -> str:
    rows = summary[(summary["parameter"] == parameter) & (summary["returned"] > 0)]
    parts = [f"`{row['method']}` {_bias(row)}, {_coverage(row)}" for _, row in rows.iterrows()]
    return f"Bias of {parameter}, median of points (range): {'; '.join(parts)}." if parts else ""


def _bias(row: pd.Series) -> str:
    median, low, high = (_signed(row[name]) for name in ("bias_median", "bias_low", "bias_high"))
    return f"{median} % ({low} to {high} %)"


def _signed(percent: float) -> str:
    return f"{percent:+.0f}" if abs(percent) >= 10 else f"{percent:+.2g}"


def _coverage(row: pd.Series) -> str:
    if not row["intervals"]:
        return "no intervals"
    share = f"{100 * row['coverage_95']:.0f} % of {row['intervals']:.0f}"
    return f"95 % intervals hold the truth in {share}: {row['coverage']}"


def _energy(summary: pd.DataFrame) -> str:
    cycle = f"of a cycle of {AMPLITUDE_MM:g} mm amplitude at the wheel centre"
    clauses = []
    for _, row in summary[(summary["parameter"] == "energy_with_true_x") & (summary["returned"] > 0)].iterrows():
        clauses.append(
            f"`{row['method']}` gives no x, so no energy; were the true x known, the energy by its k and beta would be "
            f"off by {_bias(row)}"
        )
    for _, row in summary[(summary["parameter"] == "energy_per_cycle") & (summary["returned"] > 0)].iterrows():
        clauses.append(f"`{row['method']}` gives it, off by {_bias(row)}, {_coverage(row)}")
    return f"Energy lost {cycle}: {'; '.join(clauses)}." if clauses else ""


def _declined(summary: pd.DataFrame) -> str:
    rows = summary[summary["parameter"] == "k"]
    parts = [
        f"`{row['method']}` declined {row['declined']} of {row['returned'] + row['declined']} records and warns of "
        f"{row['doubted']} of those it returned"
        for _, row in rows.iterrows()
    ]
    return f"{'; '.join(parts)}." if parts else ""


def _limits() -> str:
    return (
        "Limits: the records are of an axle that stands; their law is the one that `motion` fits and their load step "
        "is of a shape that it allows, so a real record will be harder on it. Sensors have white noise and the "
        "converter's steps, no bandwidth."
    )


def _range(low: float, high: float, unit: str) -> str:
    ends = [f"{end:.0f}" if abs(end) >= 100 else f"{end:.3g}" for end in (low, high)]
    return f"{ends[0] if np.isclose(low, high) else ' to '.join(ends)} {unit}"


def lines(summary: pd.DataFrame) -> list[str]:
    """Return the overview as lines for a terminal."""
    rows = [("method", "parameter", "bias, median (range) %", "rmse %", "coverage", "returned")]
    for _, row in summary.iterrows():
        bias = f"{row['bias_median']:+.3g} ({row['bias_low']:+.3g} to {row['bias_high']:+.3g})"
        covered = f"{100 * row['coverage_95']:.0f} %" if row["intervals"] else "-"
        returned = f"{row['returned']}/{row['returned'] + row['declined']}"
        rows.append((row["method"], row["parameter"], bias, f"{row['rmse_median']:.3g}", covered, returned))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
