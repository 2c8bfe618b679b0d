"""Force laws weighed by the records of each configuration: the table `laws.csv`, and what carried the weight.

A configuration is a tyre, or an assembly of tyres, of its own, and has a law of its own.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float
from scipy import stats

from bayes_tyre.inference.motion.hierarchy.law_pooling import counted, pooled_weights
from bayes_tyre.inference.motion.record.law_average import prior_weights
from bayes_tyre.results.comparison.model_comparison import LEAST_DIFFERENCE, STANDARD_ERRORS

LAWS_CSV = "laws.csv"
#: What each law has that Fancher's has not.
WORDS: Mapping[str, str] = {
    "fancher": "Fancher's law alone",
    "relaxing": "rubber that relaxes",
    "speed_friction": "friction that changes with speed",
    "stiffening": "stiffness that grows with deflection",
    "two_yields": "two yield displacements",
}
#: Configurations that a sentence names, and the least weight of a law in it.
_NAMED, _LEAST_NAMED = 4, 0.05


class Evidence(NamedTuple):
    """Log evidence of records by force laws.

    Attributes
    ----------
    names:
        Of the laws.
    log_evidence, reliable:
        Shape (records, laws), as `law_pooling.counted` takes them.
    own_weights:
        How probable each record by itself makes each law, shape (records, laws).
    configuration:
        Of each record, shape (records,); empty where the data name none.
    """

    names: tuple[str, ...]
    log_evidence: Float[np.ndarray, "records laws"]
    reliable: Bool[np.ndarray, "records laws"]
    own_weights: Float[np.ndarray, "records laws"]
    configuration: np.ndarray


def laws_table(evidence: Evidence, origin: str) -> pd.DataFrame:
    """Return `laws.csv`: a row a configuration and law, the greatest sum of log evidence first.

    Columns: `configuration, law, weight` (by all records of the configuration), `weight_by_record` (mean of the
    records' own), `preferred` (records whose evidence is greatest by this law), `log_evidence_difference,
    difference_se` (sum less that of the best law, and its standard error by the spread over the records; log density,
    dimensionless), `records` (in the sum), `left_out`, `reliable` (whether the evidence of all in the sum is),
    `decided` (whether the best law is ahead of every other by more than chance), `origin`. Numbers are empty for a law
    that most records have no evidence of.
    """
    tables = []
    for name in dict.fromkeys(evidence.configuration.tolist()):
        mine = evidence.configuration == name
        group = Evidence(evidence.names, *(values[mine] for values in evidence[1:]))
        tables.append(_of_configuration(group).assign(origin=origin))
    return pd.concat(tables, ignore_index=True)


def _of_configuration(evidence: Evidence) -> pd.DataFrame:
    counts = counted(evidence.log_evidence, evidence.reliable)
    n, laws = int(counts.records.sum()), counts.laws
    table = pd.DataFrame({"configuration": evidence.configuration[0], "law": list(evidence.names)})
    table["weight"] = 0.0 if n else np.nan
    table["weight_by_record"] = pd.DataFrame(evidence.own_weights).mean().to_numpy()
    empty = np.full(len(table), np.nan)
    columns = {"preferred": empty.copy(), "log_evidence_difference": empty.copy(), "difference_se": empty.copy()}
    if n:
        logs = evidence.log_evidence[np.ix_(counts.records, laws)]
        table.loc[laws, "weight"] = pooled_weights(logs, prior_weights(evidence.names)[laws])
        best = int(np.argmax(logs.sum(axis=0)))
        differences = logs - logs[:, [best]]
        columns["preferred"][laws] = np.bincount(logs.argmax(axis=1), minlength=laws.sum())
        columns["log_evidence_difference"][laws] = differences.sum(axis=0)
        columns["difference_se"][laws] = standard_errors(differences)
    table = table.assign(**columns, records=n, left_out=len(counts.records) - n, reliable=counts.reliable)
    table = table.sort_values("log_evidence_difference", ascending=False, kind="stable", ignore_index=True)
    return table.assign(decided=_decided(table))


def standard_errors(differences: Float[np.ndarray, "records laws"]) -> Float[np.ndarray, " laws"]:
    """Return the standard errors of sums over records by the spread among them; NaN of a single record."""
    n = len(differences)
    return np.sqrt(n * differences.var(axis=0, ddof=1)) if n > 1 else np.full(differences.shape[1], np.nan)


def least_difference(table: pd.DataFrame) -> Float[np.ndarray, " rows"]:
    """Return what the sum of log evidence of each row must differ by from the best's to be more than chance.

    As in `compare`; of few records, whose spread is itself uncertain, more standard errors: as improbable by Student's
    t as two are by the normal distribution.
    """
    freedom = np.maximum(table["records"].to_numpy(float) - 1, 1)
    errors = stats.t.ppf(stats.norm.cdf(STANDARD_ERRORS), freedom)
    return np.maximum(errors * table["difference_se"].to_numpy(float), LEAST_DIFFERENCE)


def _decided(table: pd.DataFrame) -> bool:
    """Return whether the first law of a configuration is ahead of every other that counts, by more than chance."""
    others = table[table["log_evidence_difference"].notna()].iloc[1:]
    ahead = -others["log_evidence_difference"] > least_difference(others)
    return bool(len(others) and ahead.all())


def sentence(table: pd.DataFrame) -> str:
    """Return which law carried the weight of each configuration, and whether by more than chance."""
    groups = [rows for _, rows in table.groupby("configuration", sort=False, dropna=False)]
    said = [_of_group(rows) for rows in groups[:_NAMED]]
    further = [f"of {len(groups) - _NAMED} more see {LAWS_CSV}"] if len(groups) > _NAMED else []
    return "; ".join(["force laws are averaged by the evidence of all records of a configuration", *said, *further])


def _of_group(rows: pd.DataFrame) -> str:
    first, counting = rows.iloc[0], rows[rows["log_evidence_difference"].notna()]
    n, name = int(first["records"]), str(first["configuration"])
    of = f"of {name}, " if name else ""
    left_out = f"; {first['left_out']} left out for unreliable evidence" if first["left_out"] and n else ""
    if not n:
        return f"{of}no record has the evidence of each law, and each has its own weights"
    records = "1 record" if n == 1 else f"{n} records"
    if len(counting) < 2:
        return f"{of}{records} have the evidence of {first['law']} alone{left_out}"
    others = counting.iloc[1:]
    tied = others[~(-others["log_evidence_difference"] > least_difference(others))]
    rival = (others if tied.empty else tied).iloc[0]
    difference = f"{-rival['log_evidence_difference']:.3g}"
    error = f" ± {rival['difference_se']:.2g}" if n > 1 else ""
    gap = f"log evidence {difference}{error} above that of {rival['law']}"
    if first["decided"]:
        text = f"over {records} {WORDS[first['law']]} ({first['law']}) carried {first['weight']:.2f} of the weight"
        return f"{of}{text}: {int(first['preferred'])} prefer it, {gap}{left_out}"
    shares = ", ".join(
        f"{row['law']} {row['weight']:.2f}"
        for _, row in counting.sort_values("weight", ascending=False, kind="stable").iterrows()
        if row["weight"] >= _LEAST_NAMED
    )
    luck = "no law is ahead by more than chance" if n > 1 else "of one record there is no scatter to judge them by"
    return f"{of}over {records} the weights are {shares}, but {luck}: {first['law']} has {gap}{left_out}"
