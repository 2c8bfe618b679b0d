"""The tests to run next, from a result's folder: `next.csv`, `plan.csv` and a figure."""

import math
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from pydantic import ValidationError

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.files import prepare_folder, whole_file
from bayes_tyre.formats.structured_text import read_toml
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.plain_text import reason
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.report.figures.tests_to_run import width_against_tests
from bayes_tyre.results.cases.untested import has_slope
from bayes_tyre.results.next_tests.candidates import Candidates, candidates, new_cases
from bayes_tyre.results.next_tests.forecast import Forecast, forecast
from bayes_tyre.results.next_tests.goals import Goal, parse_goal
from bayes_tyre.results.next_tests.plan import Costs, choose_tests, planned, ranking
from bayes_tyre.results.next_tests.rankings import WrongRanking, parse_ranking
from bayes_tyre.results.next_tests.rankings import ranking as ranking_of_configurations
from bayes_tyre.rig.faults import first_fault
from bayes_tyre.workflow.from_results.predict import read_posterior

_EXPLAINED = "the keys are explained in docs/howto/next_test.md"


class Next(NamedTuple):
    """What was written: the goal and its forecast, the two tables, the files, and where the data come from."""

    goal: Goal
    forecast: Forecast | WrongRanking
    ranked: pd.DataFrame
    plan: pd.DataFrame
    paths: tuple[Path, ...]
    origin: str
    verdict: str


def write_next(
    folder: Path,
    goal: str,
    precision: float,
    out: Path,
    *,
    cost: Path | None = None,
    tests: int = 20,
    repeats: int | None = None,
    seed: int = 0,
) -> Next:
    """Rank the tests that could follow the fit in `folder`, plan them, and write tables and figure into `out`.

    Parameters
    ----------
    goal, precision:
        As `results.next_tests.goals.parse_goal` and `rankings.parse_ranking` take it, and what is to be reached: the
        width of its interval over its median, or the probability of a wrong ranking.
    cost:
        TOML with minutes and the rig's levels.
    tests, repeats:
        Most tests of the plan; tests of each case in the ranking, by default as many as a case of the data has.
    seed:
        Of the draws of new cases.

    Raises
    ------
    BadInput
        If the folder, the goal or the cost file cannot be used; nothing is written then.
    """
    costs = read_costs(cost)
    path, tree, verdict = read_posterior(folder)
    try:
        with errors_name(path):
            posterior = tree["posterior"].to_dataset()
            cases = tree_cases(posterior)
            possible = candidates(tree, [] if has_slope(posterior) else new_cases(cases, dict(costs.rig)), seed)
            parsed, expected = _forecast(goal, possible)
            now = expected.expected(()).value
            if not math.isfinite(now):
                raise BadInput("its draws are too far apart to forecast from; run fit or motion again")
    except KeyError as error:
        raise BadInput(f"{path}: lacks {error}, so it is no posterior of fit or motion; run fit again") from None
    repeats = repeats or max(1, round(posterior.sizes["record"] / len(cases)))
    about = {"origin": tree.attrs["origin"], "verdict": verdict}
    ranked = ranking(expected, repeats, costs)
    plan = planned(expected, choose_tests(expected, precision, tests, costs), costs)
    ranked, plan = ((one if cost else one.assign(minutes=math.nan)).assign(**about) for one in (ranked, plan))
    figure = width_against_tests(plan, now, precision, parsed.text, Setting(**about))
    prepare_folder(out)
    paths = out / "next.csv", out / "plan.csv", out / "figures" / "width_against_tests.png"
    with whole_file(paths[0]) as first, whole_file(paths[1]) as second:
        write_table(ranked, first)
        write_table(plan, second)
        save(figure, paths[2])
    return Next(parsed, expected, ranked, plan, paths, **about)


def _forecast(text: str, possible: Candidates) -> tuple[Goal, Forecast | WrongRanking]:
    """Return a goal and its forecast."""
    if (asked := parse_ranking(text)) is not None:
        return ranking_of_configurations(possible, asked)
    goal = parse_goal(text, possible.cases, possible.with_records, possible.parameters)
    return goal, forecast(possible, goal)


def read_costs(path: Path | None) -> Costs:
    """Return what tests cost, from a TOML file, which `BadInput` blames; one minute each without one."""
    if path is None:
        return Costs(minutes_per_test=1.0)
    try:
        content = read_toml(path)
    except (OSError, ValueError) as error:
        raise BadInput(f"--cost {path}: cannot be read as TOML: {reason(error)}; {_EXPLAINED}") from None
    try:
        return Costs.model_validate(content)
    except ValidationError as error:
        raise BadInput(f"--cost {path}: {first_fault(error, Costs, content, _EXPLAINED)}") from None
