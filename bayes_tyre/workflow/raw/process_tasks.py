"""What each raw file needs to become a record: words, a name of its own, rig, method, picture; all found beforehand."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.raw import TRUTH
from bayes_tyre.formats.tables import read_table
from bayes_tyre.rig.axle import EMBEDDED_RIGS, Rig, load_rig
from bayes_tyre.signals.words import CASES_NEED, Words, words_from_name, words_from_row
from bayes_tyre.workflow.raw.inspect import path_text


class Task(NamedTuple):
    """What one file needs: a `bayes_tyre.workflow.execution.outcome.FileTask`.

    Attributes
    ----------
    file:
        The raw file, absolute.
    words:
        Its words, or why it cannot be used.
    rig:
        The rig; None where the file cannot be used.
    method:
        A name of `bayes_tyre.signals.process.METHODS`.
    simulated:
        Whether the simulator's table of truths beside the file names it.
    picture:
        The PNG to draw, absolute, or None.
    """

    file: Path
    words: Words | str
    rig: Rig | None
    method: str
    simulated: bool
    picture: Path | None

    def decides(self) -> dict[str, object]:
        """Return all that decides the record but the file's content."""
        words = self.words if isinstance(self.words, str) else self.words.row()
        rig = None if self.rig is None else self.rig.model_dump(mode="json")
        return {"words": words, "rig": rig, "method": self.method, "simulated": self.simulated}


class Settings(NamedTuple):
    """How to process: rig (name or TOML file), table of cases, method, folder of pictures."""

    rig: str | None = None
    cases: Path | None = None
    method: str = "inertia"
    figures: Path | None = None


def plan_tasks(files: Sequence[Path], settings: Settings) -> list[Task]:
    """Return what each file needs, its words found and its record's name its own.

    Raises
    ------
    BadInput
        If the rig or the cases are of no use.
    """
    given = load_rig(settings.rig) if settings.rig is not None else None
    own = {name: load_rig(name) for name in EMBEDDED_RIGS}
    cases = _read_cases(settings.cases) if settings.cases is not None else {}
    truths = {folder: _simulated_in(folder) for folder in {file.parent for file in files}}
    named = [_words(file, cases) for file in files]
    counts = Counter(words.record for words in named if isinstance(words, Words))
    tasks, taken = [], set()
    for file, words in zip(files, named, strict=True):
        if isinstance(words, Words) and counts[words.record] > 1:
            words = words._replace(record=_own_name(file, words.record, taken))
        record = words.record if isinstance(words, Words) else ""
        taken.add(record)
        rig = given or (own.get(words.case.configuration) if isinstance(words, Words) else None)
        if isinstance(words, Words) and rig is None:
            has = ", ".join(EMBEDDED_RIGS)
            words = f"configuration {words.case.configuration!r} has no rig of its own ({has} have); give --rig"
        picture = settings.figures / f"{_file_name(record)}.png" if settings.figures and record else None
        simulated = path_text(Path(file.name)) in truths[file.parent]
        drawn = picture.absolute() if picture is not None else None
        tasks.append(Task(file.absolute(), words, rig, settings.method, simulated, drawn))
    return tasks


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


def _simulated_in(folder: Path) -> frozenset[str]:
    """Return the files that the simulator's table of truths in a folder names."""
    try:
        table = read_table(folder / TRUTH)
        return frozenset(table.loc[table["origin"] == "simulated", "file"].astype(str))
    except (BadInput, KeyError):
        return frozenset()
