"""A record table, or the published tables, in; a posterior's folder out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.files import check_folder, prepare_folder
from bayes_tyre.formats.structured_text import read_toml
from bayes_tyre.formats.tables.column_map import read_column_map
from bayes_tyre.formats.tables.workbook import split_sheet
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.judge import judge
from bayes_tyre.inference.diagnostics.power_scaling import identify_published, identify_records
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import prepare_records, used_points
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import LEVELS
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.common_scales import with_scales_of
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical, fit_published
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.published import tables
from bayes_tyre.record import FORCE_SCALE_SD
from bayes_tyre.record_table import origin_of
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.results.columns import texts
from bayes_tyre.results.contrasts import REFERENCE, check_reference
from bayes_tyre.results.limits import OF_RECORDS, parse_limit
from bayes_tyre.results.provenance import begin_run, read_run, sha256, versions
from bayes_tyre.workflow.execution.resume import Callbacks, open_checkpoints
from bayes_tyre.workflow.record_tables import names, table_files
from bayes_tyre.workflow.result_folder import write_fit

_SAMPLER = ("chains", "warmup", "draws")
#: Missing in a `run.json` of an earlier version, and then None.
_TARGET, _COLUMNS, _LONGEST = "target_accept", "columns", "longest"
#: Options that a `run.json` has only where they were given: of the plan, and of the model.
_IF_GIVEN, _OF_MODEL_IF_GIVEN = ("limit", "reference", "record_draws"), (*LEVELS, "covariates", FORCE_SCALE_SD)


@dataclass(frozen=True)
class Plan:
    """How to fit records.

    Attributes
    ----------
    records:
        Files and folders of record tables.
    sampler, model:
        How much to sample, and of what.
    interval:
        Probability of every interval, equal-tailed.
    units_checked:
        Whether somebody vouches for suspicious units.
    columns:
        The column map's file; None: the columns are ours.
    limit:
        What `cases.csv` says the probability of, such as ``k >= 1.8``; None: nothing.
    reference:
        The configuration that others are compared with; None: the later in sorted order.
    record_draws:
        Draws of each record in `posterior.nc`; None: all, of thousands of records some
        (`bayes_tyre.inference.sampling.record_draws`).
    """

    records: tuple[Path, ...]
    sampler: SamplerSettings
    model: ModelSettings
    interval: float = 0.95
    units_checked: bool = False
    columns: Path | None = None
    limit: str | None = None
    reference: str | None = None
    record_draws: int | None = None

    def for_records(self, count: int) -> "Plan":
        """Return the plan for so many records (`SamplerSettings.for_records`)."""
        return replace(self, sampler=self.sampler.for_records(count))

    @property
    def inputs(self) -> list[Path]:
        """The files of records, then the column map if there is one."""
        return [*table_files(self.records)[0], *([] if self.columns is None else [self.columns])]

    @property
    def options(self) -> dict[str, object]:
        """What `run.json` says of it, beside the seed and the input."""
        return {
            **sampler_options(self.sampler),
            **{
                field.name: value
                for field in fields(ModelSettings)
                if (value := getattr(self.model, field.name)) or field.name not in _OF_MODEL_IF_GIVEN
            },
            "priors": self.model.priors.given(),
            **{"interval": self.interval, "units_checked": self.units_checked},
            _COLUMNS: None if self.columns is None else read_column_map(self.columns).options,
            **{name: value for name in _IF_GIVEN if (value := getattr(self, name)) is not None},
        }


def planned_in(path: Path, warn: Callable[[str], None]) -> Plan:
    """Return the plan of the fit that wrote a `run.json`, to be repeated.

    Its input is looked for where the command named it, from here and from each folder above the `run.json`. Other
    versions than today's are warned of: with them, bytes may differ.

    Raises
    ------
    BadInput
        If it is no fit's, names options that this version does not have, or its input is gone or another.
    """
    run = read_run(path)
    options, fields_of_model = run["options"], {field.name for field in fields(ModelSettings)}
    names = {*fields_of_model, *_SAMPLER, _TARGET, _COLUMNS, _LONGEST, *("interval", "units_checked"), *_IF_GIVEN}
    if unknown := sorted(set(options) - names):
        raise BadInput(
            f"{path}: option {unknown[0]} is unknown to this version; repeat the run with the version it names"
        )
    try:
        further = {"seed": run["seed"], _TARGET: options.get(_TARGET), _LONGEST: options.get(_LONGEST, 1)}
        sampler = SamplerSettings(**{key: options[key] for key in _SAMPLER}, **further)
        chosen = {key: value for key, value in options.items() if key in fields_of_model - {"priors"}}
        chosen.setdefault(FORCE_SCALE_SD, 0.0)  # left out where there was none, whatever the table says
        model = ModelSettings(**chosen, priors=PRIORS.changed(options.get("priors", {})))
        records = [_input(path, name, digest) for name, digest in run["inputs"].items()]
        columns = None if options.get(_COLUMNS) is None else records.pop()
        if not records:
            raise ValueError
        plan = Plan(
            *(tuple(records), sampler, model),
            *(float(options["interval"]), options["units_checked"] is True, columns),
            *(options.get(name) for name in _IF_GIVEN),
        )
    except (KeyError, TypeError, ValueError):
        raise BadInput(f"{path}: is not what fit writes; name the run.json in a folder that fit wrote") from None
    now = versions()
    changed = [f"{name} {was}, now {now[name]}" for name, was in run["versions"].items() if now.get(name, was) != was]
    if changed:
        warn(f"{path}: made with {'; '.join(changed)}: the bytes may differ")
    return plan


def _input(run_json: Path, name: str, digest: str) -> Path:
    above = [folder / name for folder in run_json.absolute().parents]
    there = [path for path in (Path(name), *above) if split_sheet(path)[0].is_file()]
    if not there:
        raise BadInput(f"{run_json}: its input {name} is not there; run from the folder it was run from")
    same = next((path for path in there if sha256(path) == digest), None)
    if same is None:
        raise BadInput(
            f"{there[0]}: is not the input of {run_json}: SHA-256 was {digest[:12]}..., is {sha256(there[0])[:12]}...; "
            "bring back the file, or fit this one anew"
        )
    return same


def fit_table(
    table: pd.DataFrame,
    plan: Plan,
    out: Path,
    command: Sequence[str],
    callbacks: Callbacks | None = None,
    *,
    resume: bool = False,
    xlsx: bool = False,
) -> Diagnostics:
    """Fit a record table hierarchically and write the result's folder; return the verdict.

    Parameters
    ----------
    table, plan:
        The checked table of `plan.records`, and how to fit it.
    out, command:
        The folder; and the command line, for `run.json`.
    callbacks:
        Called as the run goes on, with its warnings and its progress.
    resume:
        Go on from the checkpoints of the same run in the folder, or take its finished result.
    xlsx:
        Write the tables as one workbook too.

    Raises
    ------
    BadInput
        For a record that cannot be fitted; and, to resume, if what is in the folder is of another run.
    """
    check_folder(out)
    limit = None if plan.limit is None else parse_limit(plan.limit, OF_RECORDS)
    if plan.reference is not None:
        check_reference(plan.reference, texts(table, "configuration"))
    with errors_name(names(plan.records)):
        plan = replace(plan, model=with_scales_of(table, plan.model))
    callbacks = callbacks or Callbacks()
    run = begin_run(command, plan.options, plan.sampler.seed, plan.inputs, origin_of(table), callbacks.began)
    checkpoints = open_checkpoints(out, run, callbacks, resume)
    if isinstance(checkpoints, Diagnostics):
        return checkpoints
    settings = callbacks.settings(plan.sampler, checkpoints)
    with errors_name(names(plan.records)):
        records = prepare_records(table, plan.model)
        tree = fit_hierarchical(table, settings, plan.model, records)
    if plan.reference is not None:
        tree.attrs[REFERENCE] = plan.reference
    prepare_folder(out)
    table = used_points(table, plan.model.region)
    callbacks.on_stage("diagnostics", None)
    tree, diagnostics = judge(
        tree, lambda tree, attempt: identify_records(tree, records, plan.model, attempt), Attempts(), table
    )
    # Only records made from the printed tables have printed values to be held against.
    printed = tables.case_means() if origin_of(table) == "reconstructed" else None
    result = Result(tree, diagnostics.verdict, table, printed, plan.interval, limit=limit, reference=plan.reference)
    diagnostics = write_fit(
        result, diagnostics, run, out, xlsx=xlsx, callbacks=callbacks, record_draws=plan.record_draws
    )
    checkpoints.clear()
    return diagnostics


def fit_published_tables(
    out: Path,
    settings: SamplerSettings,
    interval: float,
    command: Sequence[str],
    priors: Priors = PRIORS,
    callbacks: Callbacks | None = None,
) -> Diagnostics:
    """Fit Tables 9 and 11 themselves and write the result's folder; return the verdict."""
    callbacks = callbacks or Callbacks()
    settings = callbacks.settings(settings)
    prepare_folder(out)
    inputs = ("published/table_09_stiffness.csv", "published/table_11_characteristic_deflection.csv")
    options = {**sampler_options(settings), "interval": interval, "priors": priors.given()}
    paths = [data_path(name) for name in inputs]
    run = begin_run(command, options, settings.seed, paths, "published", callbacks.began)
    printed = tables.case_means()
    tree = fit_published(printed, settings, priors)
    callbacks.on_stage("diagnostics", None)
    tree, diagnostics = judge(
        tree, lambda tree, attempt: identify_published(tree, printed, priors, attempt), Attempts()
    )
    result = Result(tree, diagnostics.verdict, printed=printed, interval=interval)
    return write_fit(result, diagnostics, run, out, callbacks=callbacks)


def sampler_options(settings: SamplerSettings) -> dict[str, object]:
    """Return what `run.json` says of the sampler's settings, beside the seed."""
    return {name: getattr(settings, name) for name in (*_SAMPLER, _TARGET, _LONGEST)}


def read_priors(path: Path | None) -> Priors:
    """Return the default priors with the changes in a TOML file; None: as they are.

    Raises
    ------
    BadInput
        For a file that is no TOML, and for a prior that cannot be; the message names file and key.
    """
    if path is None:
        return PRIORS
    try:
        return PRIORS.changed(read_toml(path))
    except (OSError, ValueError) as error:
        raise BadInput(f"--priors {path}: cannot be read as TOML: {error}") from None
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
