"""Comparison of models fitted to the same records or raw files, from their result folders: `comparison.csv`."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder, whole_file
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.diagnostics.attempts import Attempt, Attempts
from bayes_tyre.inference.diagnostics.leave_one_out.fits import leave_one_case_out, leave_one_record_out
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import DRAWS_LEAST, EFFECTIVE_LEAST, LeaveOneOut
from bayes_tyre.inference.motion.hierarchy.leave_one_out import leave_one_motion_out
from bayes_tyre.inference.sampling.datatree import is_of_motions
from bayes_tyre.inference.sampling.run import SamplerSettings, kept_acceptance
from bayes_tyre.results.comparison.model_comparison import CASE, by_record, compare, sentence, unit_of
from bayes_tyre.results.provenance import RUN_JSON, read_run
from bayes_tyre.workflow.fit import Plan, planned_in
from bayes_tyre.workflow.from_results.predict import NAME as PREDICTION
from bayes_tyre.workflow.from_results.predict import StoredFit, read_posterior, read_result
from bayes_tyre.workflow.record_tables import read_given
from bayes_tyre.workflow.result_names import COMPARISON, names

BY_RECORD, OF_CASES = "comparison_records.csv", "comparison_cases.csv"
#: A refit gets fewer draws than a fit: only averages over them are needed.
REFIT = SamplerSettings(warmup=400, draws=250)


type Predict[Predicted] = Callable[[SamplerSettings | None, Callable[[str], None], Attempt], Predicted]


@dataclass(frozen=True)
class Comparison:
    """A comparison that was written.

    Its table, and one of cases left out if there is one; a sentence on each; its files, what failed on the way, and
    which models are not to be trusted and why.
    """

    tables: tuple[pd.DataFrame, ...]
    sentences: tuple[str, ...]
    paths: tuple[Path, ...]
    failed: tuple[str, ...] = ()
    untrusted: tuple[str, ...] = ()


class _Model(NamedTuple):
    """A model that is compared: how to sample it again, and what predicts its records, and cases, left out, given that.

    `predict_cases` gives None where the model's cases cannot be integrated out.
    """

    sampler: SamplerSettings
    predict: Predict[LeaveOneOut]
    predict_cases: Predict[LeaveOneOut | None] = lambda *_: None


def compare_folders(
    folders: Sequence[Path],
    out: Path,
    *,
    refit: bool = True,
    on_note: Callable[[str], None] = lambda _: None,
    on_progress: Callable[[int], None] = lambda _: None,
) -> Comparison:
    """Compare the models of folders that `fit` or `motion` wrote by leave-one-record-out, and write the tables.

    Parameters
    ----------
    folders, out:
        Of the fits, or of the motions; and where the tables go.
    refit:
        Whether to fit again where importance sampling fails.
    on_note:
        Called with what the user should know, a line each.
    on_progress:
        Called with 1 after each folder.

    Raises
    ------
    BadInput
        With fewer than two folders, or where they hold no fits, or no motions, of the same records.
    """
    if len(folders) < 2:
        raise BadInput("one fit cannot be compared; name two folders or more that fit wrote from the same records")
    check_folder(out)
    models, verdicts = _models(dict(zip(names(folders), folders, strict=True)), on_note)
    left_out, of_cases = dict[str, LeaveOneOut](), dict[str, LeaveOneOut]()
    failed: list[str] = []
    for name, model in models.items():
        attempts = Attempts()
        for what, predict, done in (
            ("record", model.predict, left_out),
            ("case", model.predict_cases, of_cases),
        ):
            work = partial(_predicted, name, predict, model.sampler if refit else None, on_note, attempts)
            predicted = attempts(f"leave-one-{what}-out", work, None)
            done |= {} if predicted is None else {name: predicted}
        failed += [f"{name}: {check.reason}" for check in attempts.failed]
        on_progress(1)
    if len(left_out) < 2:
        raise BadInput(f"fewer than two models are left to compare: {'; '.join(failed)}")
    tables = {COMPARISON: compare(left_out, verdicts), BY_RECORD: by_record(left_out)}
    if of_cases.keys() == left_out.keys():  # a ranking of some of the models would be taken for one of all
        tables[OF_CASES] = compare(of_cases, verdicts, CASE)
    elif of_cases and not failed:
        without = next(name for name in left_out if name not in of_cases)
        on_note(
            f"cases left out are not ranked: those of {without} cannot be integrated out (Student-t repeats or noise, "
            "or more than six repeats of a case)"
        )
    _write(tables, out)
    ranked = [tables[name] for name in (COMPARISON, OF_CASES) if name in tables]
    # A posterior that failed is named once, an estimate in each table.
    untrusted = (
        _untrusted(name, verdicts[name], table, refit)
        for name in left_out
        for table in (ranked if verdicts[name] == "pass" else ranked[:1])
    )
    return Comparison(
        tuple(ranked),
        tuple(map(sentence, ranked)),
        tuple(out / name for name in tables),
        tuple(failed),
        tuple(filter(None, untrusted)),
    )


def _models(folders: Mapping[str, Path], on_note: Callable[[str], None]) -> tuple[dict[str, _Model], dict[str, str]]:
    """Return the model of each folder, all fits or all motions, and the verdict of each."""
    posteriors = {name: read_posterior(folder) for name, folder in folders.items()}
    trees = {name: tree for name, (_, tree, _) in posteriors.items()}
    verdicts = {name: verdict for name, (_, _, verdict) in posteriors.items()}
    fits = [name for name, tree in trees.items() if not is_of_motions(tree["posterior"].to_dataset())]
    if not fits:
        return _motions(folders, trees), verdicts
    if len(fits) < len(trees):
        raise BadInput(
            f"{folders[fits[0]]}: is of forces against displacement, others are of motions; compare results of one kind"
        )
    return _fits(folders, on_note), verdicts


def _write(tables: Mapping[str, pd.DataFrame], out: Path) -> None:
    """Write the tables, all or none, and remove what an earlier comparison has beside them."""
    prepare_folder(out)
    # What models predicted together had the weights of before; what a fit predicted alone stays as it is.
    together = () if (out / "posterior.nc").exists() else (PREDICTION, str(Path(PREDICTION).with_suffix(".toml")))
    for name in (OF_CASES, *together):
        (out / name).unlink(missing_ok=True)
    with ExitStack() as whole:
        for name, table in tables.items():
            write_table(table, whole.enter_context(whole_file(out / name)))


def _untrusted(name: str, verdict: str, compared: pd.DataFrame, refit: bool) -> str:
    """Return why a model is not to be trusted, and what to do that was not done; nothing where it is."""
    row = compared[compared["model"] == name].iloc[0]
    if row["verdict"] == "pass":
        return ""
    if verdict != "pass":
        return f"{name}: the posterior is not to be trusted; its diagnostics.json says why"
    unit, unsound = unit_of(compared), _unsound_refits(row)
    failed = "leave the model out" if unsound else f"a fit without a {unit} failed; leave the model out"
    remedy = failed if refit else "compare without --no-refit"
    if row["effective_points_min"] < EFFECTIVE_LEAST:  # fits without a record or case have no part in this
        remedy = f"fewer than {EFFECTIVE_LEAST:g} points are too few for its {unit}s; leave the model out"
    of = " of cases" if unit == CASE else ""
    return (
        f"{name}: the posterior passed, its elpd{of} is not to be trusted: Pareto k of a {unit} is "
        f"{row['pareto_k_max']:.2f} ({int(row['refitted'])} {unit}s fitted again{unsound}), the least "
        f"effective number of points {row['effective_points_min']:.0f}; {remedy}"
    )


def _unsound_refits(row: pd.Series) -> str:
    """Return how many fits without a record or case did not converge, as a part of a sentence; nothing for none."""
    disagreeing, few_draws = (int(row[name]) for name in ("refits_disagreeing", "refits_few_draws"))
    return (f", chains of {disagreeing} of these fits disagree" if disagreeing else "") + (
        f", {few_draws} of them have fewer than {DRAWS_LEAST:g} effective draws" if few_draws else ""
    )


def _predicted[Predicted](
    name: str,
    predict: Predict[Predicted],
    refit: SamplerSettings | None,
    on_note: Callable[[str], None],
    attempt: Attempt,
) -> Predicted | None:
    """Return what a model predicts of its records, or cases, left out; None stands for a failure too."""

    def say_refit(unit: str) -> None:
        on_note(f"{name}: fitted again without {unit}: it has too much influence for importance sampling")

    return predict(refit, say_refit, attempt)


def _motions(folders: Mapping[str, Path], trees: Mapping[str, xr.DataTree]) -> dict[str, _Model]:
    """Return the law of each result of `motion`.

    Raises
    ------
    BadInput
        If results are of other raw files, rigs or records.
    """
    runs = {name: read_run(folder / RUN_JSON, "motion") for name, folder in folders.items()}
    records = {name: list(tree["posterior"]["record"].to_numpy()) for name, tree in trees.items()}
    other, like = next(iter(runs.items()))
    for name, run in runs.items():
        same = set(run["inputs"].values()) == set(like["inputs"].values())
        if not same and len(records[name]) == len(records[other]):
            raise BadInput(f"{other} and {name} are not of the same raw files; run motion on one set by each law")
        if alone := sorted(set(map(str, records[name])) ^ set(map(str, records[other]))):
            raise BadInput(
                f"{other} and {name} do not both have {alone[0]}, so they are not of the same raw files, or one has no "
                "estimate of it (rejected.csv says why); run motion by each law on files that all can be fitted to"
            )
        if run["options"].get("rig") != like["options"].get("rig"):
            raise BadInput(f"{other} and {name} have different --rig; compare laws on one rig")
    return {
        name: _Model(_refit(int(runs[name]["seed"]), tree), partial(leave_one_motion_out, tree))
        for name, tree in trees.items()
    }


def _fits(folders: Mapping[str, Path], on_note: Callable[[str], None]) -> dict[str, _Model]:
    """Return the model of each result of `fit`."""
    read = [(name, *_read(folder, on_note)) for name, folder in folders.items()]
    _check_same(read)
    return {
        name: _Model(
            _refit(plan.sampler.seed, result.tree),
            partial(leave_one_record_out, result.tree, table, plan.model),
            partial(leave_one_case_out, result.tree, table, plan.model),
        )
        for name, plan, result, table in read
    }


def _refit(seed: int, tree: xr.DataTree) -> SamplerSettings:
    """Return how to sample a model without a record: with steps as short as those of its fit had to be."""
    return replace(REFIT, seed=seed, target_accept=kept_acceptance(tree))


def _read(folder: Path, on_note: Callable[[str], None]) -> tuple[Plan, StoredFit, pd.DataFrame]:
    result, plan = read_result(folder), planned_in(folder / RUN_JSON, on_note)
    return plan, result, read_given(plan.records, plan.columns).table


def _check_same(read: Sequence[tuple[str, Plan, StoredFit, pd.DataFrame]]) -> None:
    (first, plan, _, table), *others = read
    for name, other, _, records in others:
        if plan.model.region != other.model.region or not _same_points(table, records):
            raise BadInput(
                f"{first} and {name} were not fitted to the same points; fit one table with one --region by both models"
            )


def _same_points(one: pd.DataFrame, other: pd.DataFrame) -> bool:
    columns = ["record", "displacement_mm", "force_kN"]
    return one[columns].equals(other[columns])
