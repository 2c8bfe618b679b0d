"""What results on disk answer again: of a command without a posterior its last lines, of a posterior its limits."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.plain_text import one_line
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.limits import limit_sentences
from bayes_tyre.results.columns import numbers
from bayes_tyre.results.limits import parse_limit, with_limit
from bayes_tyre.results.separate_fits import read_separate_fits
from bayes_tyre.results.summary import cases
from bayes_tyre.workflow.from_results.predict import read_posterior


def answer(folder: Path) -> list[str]:
    """Return the lines that a command ended with, from the table it wrote into a folder; none for other folders.

    Raises
    ------
    BadInput
        If the table is not what the command writes.
    """
    name_of_table = next((name for name in _ANSWERS if (folder / name).is_file()), None)
    if name_of_table is None or (folder / "posterior.nc").is_file():  # beside a posterior, whose answer is its own
        return []
    try:
        return _ANSWERS[name_of_table](read_table(folder / name_of_table), folder)
    except (KeyError, AttributeError, TypeError, ValueError, IndexError) as error:
        raise BadInput(f"{folder / name_of_table}: is not what its command writes; run it again") from error


def posterior_in(folder: Path) -> Path:
    """Return the folder of the posterior that `published --posterior` wrote below its check; any other as it is."""
    below = folder / "posterior"
    return below if (below / "run.json").is_file() and not (folder / "run.json").exists() else folder


def check_posterior(folder: Path, option: str) -> None:
    """Refuse an option that is of posteriors, for a folder of results without one.

    Raises
    ------
    BadInput
        If the folder holds such results.
    """
    if answer(folder) or read_separate_fits(folder):
        raise BadInput(f"{folder}: holds no posterior, which {option} is of; leave the option out")


def limits_of(folders: Sequence[Path], limit: str) -> Iterator[str]:
    """Yield for every case of posteriors on disk how probable it is that it keeps a limit, a sentence each.

    Of several folders, each sentence begins with its own.

    Raises
    ------
    BadInput
        If a folder holds no finished result, or its cases do not have the parameter.
    """
    for folder in folders:
        path, tree, verdict = read_posterior(folder)
        with errors_name(path):
            table = with_limit(cases(tree, verdict), tree, parse_limit(limit))
        which = f"{one_line(folder, None)}: " if len(folders) > 1 else ""
        trust = "" if verdict == "pass" else " (verdict fail, not to be trusted)"
        yield from (f"{which}{sentence}{trust}" for sentence in limit_sentences(table))


def _audit(table: pd.DataFrame, folder: Path) -> list[str]:
    from bayes_tyre.studies.audit.overview import overview
    from bayes_tyre.studies.audit.sentences import lines

    path = folder / "conclusion.txt"
    conclusion = ["", *path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    return ["audit of the methods on simulated records, not measured", *lines(overview(table)), *conclusion]


def _calibration(table: pd.DataFrame, _folder: Path) -> list[str]:
    wrong = table.loc[~table["calibrated"].astype(bool), "parameter"].tolist()
    not_so = [f"not calibrated: {', '.join(map(str, wrong))}"] if wrong else []
    return [
        "calibration on simulated data sets, not measured",
        f"calibrated: {len(table) - len(wrong)} of {len(table)} parameters",
        *not_so,
    ]


def _outliers(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.studies.outliers import overview_lines

    return ["discordant repeats in simulated campaigns, not measured", *overview_lines(table)]


def _motion(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.studies.motion_study import sentences

    return ["motions simulated with known truth, not measured", *sentences(table)]


def _laws(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.studies.law_ranking import sentences

    return ["laws ranked on records simulated with each, not measured", *sentences(table)]


def _coverage(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.studies.coverage import overview

    rows = overview(table).to_string(index=False).splitlines()
    return ["coverage of 95 % intervals ± its standard error, of simulated data sets, not measured", *rows]


def _modes(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.results.flexible_ring import parameter_lines

    about = f"flexible ring (data: {table['origin'].iloc[0]}): verdict {table['verdict'].iloc[0]}"
    return [about, *parameter_lines(table)]


def _next(table: pd.DataFrame, folder: Path) -> list[str]:
    from bayes_tyre.results.next_tests.sentences import candidate_lines, measure_of, plan_line

    about = f"tests to run next (data: {table['origin'].iloc[0]}, verdict {table['verdict'].iloc[0]})"
    given = {name: numbers(table, name) for name in (*CASE_FACTORS[2:], "minutes")}  # a blank cell makes a column text
    plan = read_table(folder / "plan.csv")
    now = float(table[f"{measure_of(table)}_now"].iloc[0])
    timed = plan.assign(minutes=numbers(plan, "minutes"))
    return [about, *candidate_lines(table.assign(**given)), plan_line(timed, now)]


def _comparison(table: pd.DataFrame, folder: Path) -> list[str]:
    from bayes_tyre.results.comparison.model_comparison import rank_lines, sentence
    from bayes_tyre.workflow.from_results.compare import OF_CASES

    of_cases = folder / OF_CASES
    tables = [table, *([read_table(of_cases)] if of_cases.exists() else [])]
    return ["models compared by leave-one-out", *(line for one in tables for line in (*rank_lines(one), sentence(one)))]


def _prediction(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.workflow.from_results.predict import answers

    about = f"predicted curves (data: {table['origin'].iloc[0]}, verdict {table['verdict'].iloc[0]})"
    return [about, *answers(table, len(table))]


def _published(table: pd.DataFrame, _folder: Path) -> list[str]:
    from bayes_tyre.workflow.published import agreement_lines

    return ["published numbers recomputed", *agreement_lines(table)]


#: By the table that only this command writes.
_ANSWERS: Mapping[str, Callable[[pd.DataFrame, Path], list[str]]] = {
    "audit.csv": _audit,
    "calibration.csv": _calibration,
    "outliers.csv": _outliers,
    "motion_study.csv": _motion,
    "law_ranking.csv": _laws,
    "coverage.csv": _coverage,
    "modes.csv": _modes,
    "next.csv": _next,
    "comparison.csv": _comparison,
    "prediction.csv": _prediction,
    "published_check.csv": _published,
}
