"""Raw files in, a record table and the rejected files out; a file that fails is a row and stops no other."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder
from bayes_tyre.formats.raw import TRUTH, read_raw
from bayes_tyre.formats.tables import read_table, write_table
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import EMBEDDED_RIGS, Rig, load_rig
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals.process import process
from bayes_tyre.signals.words import CASES_NEED, Words, words_from_name, words_from_row
from bayes_tyre.workflow.inspect import path_text
from bayes_tyre.workflow.parallel import in_parallel

REJECTED = "rejected.csv"
#: What the simulator's files and its table of true parameters say of themselves.
_SIMULATED = "simulated by bayes-tyre"


class Task(NamedTuple):
    """What one file needs: picklable, so that any process can do it.

    Attributes
    ----------
    file:
        The raw file.
    words:
        Its words, or why it has none.
    rig:
        Name or TOML file; None for the rig that the configuration names.
    method:
        A name of `bayes_tyre.signals.process.METHODS`.
    picture:
        The PNG to draw, or None.
    """

    file: Path
    words: Words | str
    rig: str | None
    method: str
    picture: Path | None


class Settings(NamedTuple):
    """How to process: rig, table of cases, method, folder of pictures, processes (None: a core each)."""

    rig: str | None = None
    cases: Path | None = None
    method: str = "inertia"
    figures: Path | None = None
    workers: int | None = None


def process_files(
    files: Sequence[Path], settings: Settings, out: Path, on_progress: Callable[[int], None]
) -> tuple[int, int]:
    """Write the record table of raw files and `rejected.csv` beside it; return how many records, how many rejected.

    Parameters
    ----------
    files:
        As `bayes_tyre.formats.raw.raw_files` finds them.
    settings:
        Rig, cases, method, pictures, processes.
    out:
        A `.csv` or `.parquet` file. Its rows are in the order of the files, whatever the number of processes.
    on_progress:
        Called with 1 after each file.

    Raises
    ------
    BadInput
        If the rig, the cases or `out` are of no use, before the work; if no file is, after `rejected.csv` was written.
    """
    if out.is_dir() or out.suffix.lower() not in (".csv", ".parquet"):
        raise BadInput(f"--out {out}: is no .csv or .parquet file; name one")
    for folder in (out.parent, *([settings.figures] if settings.figures else [])):
        check_folder(folder)
    if settings.rig is not None:
        load_rig(settings.rig)
    tasks = plan_tasks(files, settings)
    outcomes = in_parallel(process_file, tasks, settings.workers, on_progress)
    rejected = pd.DataFrame(
        [
            (path_text(task.file), result)
            for task, result in zip(tasks, outcomes, strict=True)
            if isinstance(result, str)
        ],
        columns=["file", "reason"],
        dtype=object,
    )
    records = [result for result in outcomes if not isinstance(result, str)]
    write_table(rejected, out.parent / REJECTED)
    if not records:
        first = f": {rejected['reason'].iloc[0]}" if len(rejected) else ""
        raise BadInput(f"{out.parent / REJECTED}: none of {len(tasks)} files can be used, the first{first}")
    write_table(pd.concat(records, ignore_index=True), out)
    return len(records), len(rejected)


def plan_tasks(files: Sequence[Path], settings: Settings) -> list[Task]:
    """Return what each file needs, its words found and its record's name its own."""
    cases = _read_cases(settings.cases) if settings.cases is not None else {}
    named = [_words(file, cases) for file in files]
    names = [words.record for words in named if isinstance(words, Words)]
    tasks, taken = [], set()
    for file, words in zip(files, named, strict=True):
        if isinstance(words, Words) and names.count(words.record) > 1:
            words = words._replace(record=_own_name(file, words.record, taken))
        record = words.record if isinstance(words, Words) else ""
        taken.add(record)
        picture = settings.figures / f"{_file_name(record)}.png" if settings.figures and record else None
        tasks.append(Task(file, words, settings.rig, settings.method, picture))
    return tasks


def process_file(task: Task) -> pd.DataFrame | str:
    """Return the rows of a file's record, or why there are none; draw its picture if one is wanted."""
    prepare_jax()
    try:
        if isinstance(task.words, str):
            raise BadInput(task.words)
        raw = read_raw(task.file)
        rig = _rig(task.rig, task.words.case.configuration)
        processed = process(raw, rig, task.words, task.method)
    except BadInput as error:
        text = str(error)
        return path_text(Path(text.removeprefix(f"{task.file}: ")))
    origin = _origin(raw, task.file)
    if task.picture is not None:
        from bayes_tyre.report.process_figures import draw_record

        draw_record(processed, origin, task.picture)
    return pd.DataFrame({**processed.columns(), "origin": origin})


def _words(file: Path, cases: dict[str, dict[str, object]]) -> Words | str:
    name = path_text(Path(file.name))
    row = cases.get(path_text(file), cases.get(name))
    try:
        return words_from_row(row, name) if row is not None else words_from_name(name)
    except BadInput as error:
        return str(error)


def _read_cases(path: Path) -> dict[str, dict[str, object]]:
    """Return the rows of a table of cases by file."""
    table = read_table(path)
    missing = [name for name in CASES_NEED if name not in table.columns]
    if missing:
        raise BadInput(f"--cases {path}: missing column {', '.join(missing)}; it needs {', '.join(CASES_NEED)}")
    files = table["file"].astype(str).str.strip()
    if files.duplicated().any():
        raise BadInput(f"--cases {path}, column file: {files[files.duplicated()].iloc[0]!r} stands twice; keep one row")
    rows = [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]
    return dict(zip(files, rows, strict=True))


def _own_name(file: Path, record: str, taken: set[str]) -> str:
    """Return a record's name with as many of its file's folders before it as make it unique."""
    name = record
    for folder in reversed(file.absolute().parent.parts):
        name = f"{path_text(Path(folder)).strip('/')}/{name}"
        if name not in taken:
            break
    return name


def _file_name(record: str) -> str:
    return "".join("_" if c in '/\\:*?"<>|' or not c.isprintable() else c for c in record)


@lru_cache(maxsize=8)
def _rig(name: str | None, configuration: str) -> Rig:
    if name is None and configuration not in EMBEDDED_RIGS:
        raise BadInput(
            f"configuration {configuration!r} has no rig of its own ({', '.join(EMBEDDED_RIGS)} have); give --rig"
        )
    return load_rig(name or configuration)


def _origin(raw: RawSignals, file: Path) -> str:
    """Return `simulated` where the file, or the simulator's table of truths beside it, says so."""
    if any(_SIMULATED in text for text in raw.notes):
        return "simulated"
    return "simulated" if path_text(Path(file.name)) in _truths(file.parent) else "measured"


@lru_cache(maxsize=8)
def _truths(folder: Path) -> frozenset[str]:
    try:
        table = read_table(folder / TRUTH)
        return frozenset(table.loc[table["origin"] == "simulated", "file"].astype(str))
    except (BadInput, KeyError):
        return frozenset()
