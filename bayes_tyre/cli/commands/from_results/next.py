"""`next`: which tests to run to reach the wanted precision of a ratio or a value."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayes_tyre.cli.shell import NOT_TRUSTED, Out, Quiet, Seed, say, warn
from bayes_tyre.plain_text import number_in

if TYPE_CHECKING:
    from bayes_tyre.workflow.from_results.next import Next


def next(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that fit or motion wrote.")],
    goal: Annotated[
        str,
        typer.Option(
            help="What is to be known: 'k dual / single' or 'beta loading / unloading', a ratio over the cases that "
            "match as in contrasts.csv; 'k single (0)30-20', a case; 'ranking k', the ratio of the two configurations "
            "whose order is least certain; 'wrong ranking k', the probability that the order is wrong; of motion also "
            "'energy_per_cycle dual / single'."
        ),
    ],
    precision: Annotated[
        str,
        typer.Option(
            help="Width of its 95 % interval over its median to reach: 2% or 0.02; of a wrong ranking its probability."
        ),
    ],
    out: Out,
    cost: Annotated[
        Path | None,
        typer.Option(
            help="TOML: minutes_per_test, budget_minutes, [setup_minutes] of a change of a factor, and [rig] with the "
            "levels it can be set to: speed_km_h (km/h), initial_load_kN, step_kN (kN, signed)."
        ),
    ] = None,
    tests: Annotated[int, typer.Option(min=1, help="Tests of the plan at most.")] = 20,
    repeats: Annotated[
        int | None,
        typer.Option(min=1, help="Tests of each case that next.csv compares; default: as many as a case of DIR has."),
    ] = None,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Forecast how further tests narrow the 95 % interval of a ratio or a value (k kN/mm, beta mm), and plan them.

    Candidates are repeats of the cases of DIR, and new cases that combine its levels (or those of [rig]). Writes
    next.csv (a row a candidate, the best first: minutes, width now and expected), plan.csv (tests in order) and
    figures/width_against_tests.png. Widths are shares of the median. Where the goal is far from normal its draws are
    weighted by simulated outcomes of the tests (method: reweighted).

    Example: bayes-tyre next results/fit --goal 'k dual / single' --precision 2% --out results/next
    """
    target = _share(precision)
    from bayes_tyre.workflow.from_results.next import write_next

    result = write_next(folder, goal, target, out, cost=cost, tests=tests, repeats=repeats, seed=seed)
    for line in _lines(result, target):
        say(line, quiet)
    for path in result.paths:
        say(f"wrote {path} (data: {result.origin}, verdict {result.verdict})", quiet)
    if result.forecast.doubtful and not _reweighted(result):
        warn(f"{goal}: its posterior is far from normal: what is expected is doubtful; fit again after a few tests")
    if result.verdict != "pass":
        warn(f"the posterior is not to be trusted, nor is the forecast; {folder / 'diagnostics.json'} gives the reason")
        raise typer.Exit(NOT_TRUSTED)


def _share(text: str) -> float:
    share = (number_in(text.removesuffix("%")) or 0.0) / (100.0 if text.endswith("%") else 1.0)
    if not 0.0 < share < 10.0:
        raise typer.BadParameter(f"{text[:60]!r} is no share of the median; give 2% or 0.02", param_hint="--precision")
    return share


def _reweighted(result: "Next") -> bool:
    """Return whether the forecasts of the best candidate and of the plan were both computed by reweighting."""
    from bayes_tyre.results.next_tests.forecast import REWEIGHTED

    return all((table["method"] == REWEIGHTED).all() for table in (result.ranked.head(1), result.plan.tail(1)))


def _lines(result: "Next", precision: float) -> list[str]:
    """Return lines on the present precision of the goal, the best candidates, and what the plan reaches."""
    from bayes_tyre.results.next_tests.rankings import WrongRanking
    from bayes_tyre.results.next_tests.sentences import after, candidate_lines, percent, shown

    forecast = result.forecast
    now, enough = shown(forecast.expected(()).value, forecast.measure), percent(precision)
    if isinstance(forecast, WrongRanking):
        goal = f"{result.goal.text}: {result.goal.of}, wrong with probability {now}"
    else:
        goal = f"{result.goal.text}: median {forecast.median:.4g}, 95 % interval {now} of it wide ({result.goal.of})"
    lines = [goal, *candidate_lines(result.ranked)]
    if result.plan.empty:
        return [*lines, f"plan: no test, as {now} is within {enough} or no test is within the budget"]
    last = result.plan.iloc[-1]
    reached = "" if last[f"{forecast.measure}_expected"] <= precision else "not "
    expected = after(last, forecast.measure)
    return [*lines, f"plan {reached}expected to reach {enough}: {len(result.plan)} tests, {now} to {expected}"]
