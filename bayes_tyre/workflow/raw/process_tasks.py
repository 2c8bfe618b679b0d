"""The task of each raw file: its factors, unique record name, rig, method and figure, found before the work."""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.recordings.raw import TRUTH
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.plain_text import listed, path_text, quoted
from bayes_tyre.results.columns import texts
from bayes_tyre.rig.axle import EMBEDDED_RIGS, Rig, load_rig
from bayes_tyre.signals.factors import CASES_NEED, RecordFactors, factors_from_name, factors_from_row


class Task(NamedTuple):
    """The task of one raw file: a `bayes_tyre.workflow.execution.outcome.FileTask`.

    Attributes
    ----------
    file:
        The raw file, absolute.
    factors:
        Its factors, or why it cannot be used.
    rig:
        The rig; None where the file cannot be used.
    method:
        A name of `bayes_tyre.signals.process.METHODS`.
    simulated:
        Whether the simulator's table of truths beside the file names it.
    figure:
        The PNG to draw, absolute, or None.
    rig_file:
        The rig file that its row of the table of cases names, or None.
    """

    file: Path
    factors: RecordFactors | str
    rig: Rig | None
    method: str
    simulated: bool
    figure: Path | None
    rig_file: Path | None = None

    def decides(self) -> dict[str, object]:
        """Return what determines the record beside the file's content."""
        factors = self.factors if isinstance(self.factors, str) else self.factors.row()
        rig = None if self.rig is None else self.rig.model_dump(mode="json")
        return {"factors": factors, "rig": rig, "method": self.method, "simulated": self.simulated}


class Settings(NamedTuple):
    """How to process: rig (name or TOML file) of files whose case names none, table of cases, method, figures."""

    rig: str | None = None
    cases: Path | None = None
    method: str = "inertia"
    figures: Path | None = None


def plan_tasks(files: Sequence[Path], settings: Settings) -> list[Task]:
    """Return a task a file, with its factors and a unique record name.

    Raises
    ------
    BadInput
        If the rig or the cases cannot be used.
    """
    given = () if settings.rig is None else (settings.rig,)
    cases = _read_cases(settings.cases) if settings.cases is not None else {}
    rigs = {name: load_rig(name) for name in (*EMBEDDED_RIGS, *given)} | _rigs_of_rows(settings.cases, cases)
    truths = {folder: _simulated_in(folder) for folder in {file.parent for file in files}}
    rows = [cases.get(path_text(file), cases.get(path_text(Path(file.name)))) for file in files]
    _note_unused(settings.cases, cases, files)
    named = [_factors(file, row) for file, row in zip(files, rows, strict=True)]
    counts = Counter(factors.record for factors in named if isinstance(factors, RecordFactors))
    tasks, taken = [], set()
    for file, row, factors in zip(files, rows, named, strict=True):
        if isinstance(factors, RecordFactors) and counts[factors.record] > 1:
            factors = factors._replace(record=_unique_name(file, factors.record, taken))
        record = factors.record if isinstance(factors, RecordFactors) else ""
        taken.add(record)
        own = str(row["rig"]) if row else ""
        factors, rig = _with_rig(factors, own or settings.rig, rigs)
        figure = settings.figures / f"{_file_name(record)}.png" if settings.figures and record else None
        simulated = path_text(Path(file.name)) in truths[file.parent]
        drawn = figure.absolute() if figure is not None else None
        rig_file = Path(own) if own and own not in EMBEDDED_RIGS else None
        tasks.append(Task(file.absolute(), factors, rig, settings.method, simulated, drawn, rig_file))
    return tasks


def _with_rig(
    factors: RecordFactors | str, name: str | None, rigs: Mapping[str, Rig]
) -> tuple[RecordFactors | str, Rig | None]:
    """Return a file's factors, or why it cannot be used, and the rig of this name, or its configuration's own."""
    if isinstance(factors, str):
        return factors, None
    configuration = factors.case.configuration
    if name or configuration in EMBEDDED_RIGS:
        return factors, rigs[name or configuration]
    has = ", ".join(EMBEDDED_RIGS)
    return f"configuration {configuration!r} has no embedded rig ({has} have); give --rig", None


def _factors(file: Path, row: dict[str, object] | None) -> RecordFactors | str:
    name = path_text(Path(file.name))
    try:
        return factors_from_row(row, name) if row is not None else factors_from_name(name)
    except BadInput as error:
        return str(error)


def _read_cases(path: Path) -> dict[str, dict[str, object]]:
    """Return the rows of a table of cases by file; `rig` is a name, a path from where the command runs, or empty."""
    table = read_table(path)
    missing = [name for name in CASES_NEED if name not in table.columns]
    if missing:
        raise BadInput(f"--cases {path}: missing column {', '.join(missing)}; it needs {', '.join(CASES_NEED)}")
    files = table["file"].astype(str).str.strip()
    if files.duplicated().any():
        raise BadInput(f"--cases {path}, column file: {files[files.duplicated()].iloc[0]!r} occurs twice; keep one row")
    rigs = texts(table, "rig")
    table["rig"] = [str(path.parent / rig) if rig and rig not in EMBEDDED_RIGS else rig for rig in rigs]
    rows = [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]
    return dict(zip(files, rows, strict=True))


def _note_unused(path: Path | None, cases: Mapping[str, object], files: Sequence[Path]) -> None:
    """Warn of rows of the table of cases that are of no file: a name that is misspelt would be read from the file's."""
    there = {path_text(file) for file in files} | {path_text(Path(file.name)) for file in files}
    if unused := [file for file in cases if file not in there]:
        text = f"--cases {path}: no file was given for {len(unused)} of its rows: {listed(unused, 3, quoted)}"
        warnings.warn(text, stacklevel=3)


def _rigs_of_rows(path: Path | None, cases: Mapping[str, Mapping[str, object]]) -> dict[str, Rig]:
    """Return the rigs that rows of the table of cases name."""
    rigs: dict[str, Rig] = {}
    for file, row in cases.items():
        name = str(row["rig"])
        if name and name not in rigs:
            with errors_name(f"--cases {path}, row of {file!r}, column rig"):
                rigs[name] = load_rig(name)
    return rigs


def _unique_name(file: Path, record: str, taken: set[str]) -> str:
    """Return a record's name with as many of its file's folders before it as make it unique."""
    name = record
    for folder in reversed(file.absolute().parent.parts):
        name = f"{path_text(Path(folder)).strip('/')}/{name}"
        if name not in taken:
            break
    return name


def _file_name(record: str) -> str:
    return "".join("_" if c in '/\\:*?"<>|' or not c.isprintable() else c for c in record)


def _simulated_in(folder: Path) -> frozenset[str]:
    """Return the files that the simulator's table of truths in a folder names."""
    try:
        table = read_table(folder / TRUTH)
        return frozenset(table.loc[table["origin"] == "simulated", "file"].astype(str))
    except (BadInput, KeyError):
        return frozenset()
