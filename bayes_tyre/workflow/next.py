"""The tests to run next, from a result's folder: `next.csv`, `plan.csv` and a figure."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import prepare_folder, whole_file
from bayes_tyre.formats.tables import write_table
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.colours import Setting
from bayes_tyre.report.figures.layout import save
from bayes_tyre.report.figures.tests_to_run import width_against_tests
from bayes_tyre.results.candidates import LEVELS, candidates, new_cases
from bayes_tyre.results.forecast import Forecast, forecast
from bayes_tyre.results.goals import Goal, parse_goal
from bayes_tyre.results.plan import Costs, choose_tests, planned, ranking
from bayes_tyre.workflow.predict import errors_name, read_posterior

_KEYS = ("minutes_per_test", "budget_minutes", "setup_minutes", "rig")


class Next(NamedTuple):
    """What was written: the goal and its forecast, the two tables, the files, and where the data come from."""

    goal: Goal
    forecast: Forecast
    ranked: pd.DataFrame
    plan: pd.DataFrame
    paths: tuple[Path, ...]
    origin: str
    verdict: str


def write_next(
    folder: Path, goal: str, precision: float, out: Path, *, cost: Path | None = None, tests: int, repeats: int | None
) -> Next:
    """Rank the tests that could follow a fit, plan them, and write both tables and the figure into `out`.

    Parameters
    ----------
    folder, out:
        Of the fit, and of the files.
    goal, precision:
        As `bayes_tyre.results.goals.parse_goal` takes it, and the width of its interval over its median to be reached.
    cost:
        TOML with minutes and the rig's levels.
    tests, repeats:
        Most tests of the plan; tests of each case in the ranking, by default as many as a case of the data has.

    Raises
    ------
    BadInput
        If the folder, the goal or the cost file cannot be used; nothing is written then.
    """
    costs, levels = read_costs(cost)
    path, tree, verdict = read_posterior(folder)
    with errors_name(path):
        posterior = tree["posterior"].to_dataset()
        known = tree_cases(posterior)
        of_slope = "log_k_load" in posterior and posterior.sizes["load"] == 1  # a new case's actual force is not known
        possible = candidates(tree, [] if of_slope else new_cases(known, levels))
        parsed = parse_goal(goal, possible.cases, len(known), possible.parameters)
    expected = forecast(possible, parsed)
    repeats = repeats or max(1, round(posterior.sizes["record"] / len(known)))
    about = {"origin": tree.attrs["origin"], "verdict": verdict}
    ranked = ranking(expected, repeats, costs).assign(**about)
    plan = planned(expected, choose_tests(expected, precision, tests, costs), costs).assign(**about)
    figure = width_against_tests(plan, expected.width(), precision, parsed.text, Setting(**about))
    prepare_folder(out)
    paths = out / "next.csv", out / "plan.csv", out / "figures" / "width_against_tests.png"
    with whole_file(paths[0]) as first, whole_file(paths[1]) as second:
        write_table(ranked, first)
        write_table(plan, second)
        save(figure, paths[2])
    return Next(parsed, expected, ranked, plan, paths, **about)


def read_costs(path: Path | None) -> tuple[Costs, Mapping[str, Sequence[float]]]:
    """Return what tests cost and the levels that the rig can be set to, from a TOML file; nothing without one.

    Raises
    ------
    BadInput
        For a file that is no TOML, an unknown key, and a value that cannot be.
    """
    if path is None:
        return Costs(), {}
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise BadInput(f"--cost {path}: cannot be read as TOML: {error}; write minutes_per_test = 10") from None
    setup, rig = content.get("setup_minutes", {}), content.get("rig", {})
    levels = (
        [level for of_factor in rig.values() for level in (of_factor or [None])] if isinstance(rig, dict) else [None]
    )
    minutes = {name: content[name] for name in _KEYS[:2] if name in content}
    right = set(content) <= set(_KEYS) and isinstance(setup, dict) and set(setup) <= set(CASE_FACTORS)
    right = right and all(_is_number(value, 0.0) for value in (*minutes.values(), *setup.values()))
    if not (right and set(rig) <= set(LEVELS) and all(map(_is_number, levels))):
        raise BadInput(
            f"--cost {path}: holds minutes_per_test and budget_minutes, [setup_minutes] by factor and [rig] "
            f"with lists of {', '.join(LEVELS)}, all numbers; correct it"
        )
    if (setup or "budget_minutes" in minutes) and not minutes.get("minutes_per_test"):
        raise BadInput(f"--cost {path}: minutes_per_test is missing; give the minutes of one test, such as 10")
    return Costs(**minutes, setup_minutes=setup), rig


def _is_number(value: Any, least: float = -math.inf) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= least
