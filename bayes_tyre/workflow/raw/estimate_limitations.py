"""What the estimates of single records mean for the result of all: limitations, and where most failed, the verdict."""

import pandas as pd

from bayes_tyre.inference.diagnostics.data_checks import fault
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.motion.record.likelihood import WIDENED
from bayes_tyre.plain_text import listed
from bayes_tyre.record import LAW_PARAMETERS, parameter_column
from bayes_tyre.results.comparison.law_weights import LAWS_CSV, sentence
from bayes_tyre.workflow.raw.estimate_columns import FORCE_PERCENT, MODE_HZ, OK, RINGING_HZ, WEIGHT, WITHOUT_FORCE
from bayes_tyre.workflow.raw.raw_records import REJECTED

ESTIMATES = "estimates.csv"
#: Records that a sentence names.
_NAMED = 3


def with_estimates(
    diagnostics: Diagnostics, table: pd.DataFrame, rejected: int, laws: pd.DataFrame | None = None
) -> Diagnostics:
    """Return the verdict with the limitations of the records' estimates.

    An estimate that failed its check is kept, for to drop records that do not fit is to choose the result; it is
    widened instead, and named. Where that is half of them or more, the cases rest on what nobody checked.

    Parameters
    ----------
    diagnostics:
        Of the hierarchy.
    table, rejected:
        The rows of `estimates.csv`, and the number of files without one.
    laws:
        `laws.csv` where the laws were weighted by it; None: each record by itself, or one law.
    """
    # First what carried the weight, which the answer shows: of many limitations the last are in a file.
    limitations = [*_of_laws(table, laws), *diagnostics.limitations, *_limitations(table, rejected)]
    bad = table[table["status"] != OK]
    if bad.empty:
        return diagnostics._replace(limitations=tuple(limitations))
    where = listed(bad["record"].tolist(), _NAMED)
    finding = (
        f"the estimate failed its check and counts with standard deviations {WIDENED:g} times as wide; see status in "
        f"{ESTIMATES}"
    )
    if 2 * len(bad) < len(table):
        return diagnostics._replace(limitations=(*limitations, f"{where}: {finding}"))
    finding += f": these are {len(bad)} of {len(table)} records"
    check = fault(where, finding, "record them again, check the rig file, or try another --law, such as auto")
    return diagnostics._replace(
        verdict="fail",
        reasons=(*diagnostics.reasons, check.reason),
        limitations=tuple(limitations),
        checks=[*diagnostics.checks, check.row],
    )


def _of_laws(table: pd.DataFrame, laws: pd.DataFrame | None) -> list[str]:
    """Return what carried the weight of an average over laws; nothing of a single law."""
    if laws is not None:
        return [f"{sentence(laws)}; see {LAWS_CSV}"]
    weights = table.filter(regex=f"^{WEIGHT}").mean().sort_values(ascending=False)
    if weights.empty:
        return []
    shares = [f"{str(name).removeprefix(WEIGHT)} {weight:.2f}" for name, weight in weights.items()]
    said = (
        "force laws are averaged record by record, weighted by their evidence: in the mean of "
        f"{len(table)} records {', '.join(shares)}; {LAWS_CSV} has what the records of a configuration say together, "
        "by which --law auto_campaign weights all of them"
    )
    if weights.index[0] != f"{WEIGHT}{FANCHER.name}":
        said += f"; with --law {shares[0].split()[0]} {ESTIMATES} has what it adds"
    return [said]


def _limitations(table: pd.DataFrame, rejected: int) -> list[str]:
    """Return limitations: files without an estimate, a second mode, loads that ring, and forces that are left out."""
    sentences = []
    if rejected:
        files = "1 file has no estimate and is" if rejected == 1 else f"{rejected} files have no estimate and are"
        sentences.append(f"{files} not in the result: see {REJECTED}")
    shaken = table[table[MODE_HZ].notna()]
    if len(shaken):
        sentences.append(
            f"{listed(shaken['record'].tolist(), _NAMED)}: the sensors show a second mode of the rig, at "
            f"{shaken[MODE_HZ].median():.0f} Hz, which was fitted too; if the rig has none, look at the channels"
        )
    ringing = table[table[RINGING_HZ].notna()]
    if len(ringing):
        sentences.append(
            f"{listed(ringing['record'].tolist(), _NAMED)}: the load rings after its step, at "
            f"{ringing[RINGING_HZ].median():.0f} Hz, which was fitted too"
        )
    forced = table[table[FORCE_PERCENT] > 0]
    if len(forced):
        parameters = {parameter_column(parameter): parameter for parameter in LAW_PARAMETERS}
        columns = [name.removesuffix(WITHOUT_FORCE) for name in map(str, forced) if name.endswith(WITHOUT_FORCE)]
        times = [
            f"{(forced[f'{name}{WITHOUT_FORCE}'] / forced[f'{name}_se']).median():.2g} times for {parameters[name]}"
            for name in columns
        ]
        of_fancher = f"{parameter_column('x')}_se" in table and table.filter(regex=f"^{WEIGHT}").empty
        hint = "; --law auto fits what a tyre may have beyond Fancher's law" if of_fancher else ""
        sentences.append(
            f"{len(forced)} of {len(table)} records: load and law leave out a force, in the median of "
            f"{forced[FORCE_PERCENT].median():.2g} % of the load's step; were it certain that there is none, standard "
            f"errors would be {', '.join(times)} as large, in the median{hint}"
        )
    return sentences
