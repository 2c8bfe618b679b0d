"""Results of a batch, cached on disk file by file, so that a resumed run computes only what is missing."""

import hashlib
import json
import shutil
from collections.abc import Iterable
from pathlib import Path

from bayes_tyre.formats.files import remove_leftovers, whole_file, write_text
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.joined import is_part, write_part
from bayes_tyre.workflow.execution.outcome import Done, Fault

_RESULT, _REASON, _FIGURE = ".part", ".reason", ".picture"
_README = """Results of each raw file, table or simulated data set of {out}: with --resume, bayes-tyre computes only
what is missing here or has changed. Names are fingerprints of all that decides a result: the file's content, factors,
rig, method, version; of a table its sheet, column map, settings; of a data set its kind, number, seed, sampler and
version.

.part     the rows of a record, or of a data set (Parquet)
.reason   why a file was rejected (JSON)
.picture  the SHA-256 of the figure drawn with it

The folder may be removed: the next run then computes everything again.
"""


class TaskCache:
    """A folder of results beside the table that they become; every file in it is whole or absent."""

    def __init__(self, out: Path) -> None:
        self.folder = out.with_name(f".{out.name}.parts")
        self._out = out

    def prepare(self, resume: bool, figures: Iterable[Path]) -> None:
        """Make the folder, emptied unless to resume; remove half-written files of a killed run."""
        if not resume:
            self.remove()
        readme = self.folder / "README.txt"
        for path in self._files():
            if path.name.startswith("."):
                path.unlink(missing_ok=True)
        remove_leftovers(figures)
        write_text(_README.format(out=self._out.name), readme)

    def find(self, key: str, figure: Path | None) -> Path | Fault | None:
        """Return the result cached under a fingerprint, or None; None too where the wanted figure is missing."""
        reason, result = self.folder / f"{key}{_REASON}", self.folder / f"{key}{_RESULT}"
        try:
            return Fault(read_json(reason))
        except (OSError, ValueError):  # a power cut may leave a file empty
            pass
        return result if is_part(result) and (figure is None or self._is_drawn(key, figure)) else None

    def keep(self, key: str, done: Done | Fault, figure: Path | None) -> Path | Fault:
        """Write the outcome of a file: its figure first, so that no result is without it."""
        if isinstance(done, Fault):
            write_text(json.dumps(done.reason), self.folder / f"{key}{_REASON}")
            return done
        if figure is not None and done.figure is not None:
            with whole_file(figure) as beside:
                beside.write_bytes(done.figure)
            write_text(hashlib.sha256(done.figure).hexdigest(), self.folder / f"{key}{_FIGURE}")
        return write_part(done.table, self.folder / f"{key}{_RESULT}")

    def keep_only(self, keys: Iterable[str]) -> None:
        """Remove results that no file of this run has, so that the folder does not grow."""
        wanted = set(keys)
        for path in self._files():
            if path.suffix in (_RESULT, _REASON, _FIGURE) and path.stem not in wanted:
                path.unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder."""
        if self.folder.exists():
            shutil.rmtree(self.folder)

    def _files(self) -> list[Path]:
        return list(self.folder.iterdir()) if self.folder.exists() else []

    def _is_drawn(self, key: str, figure: Path) -> bool:
        """Return whether a figure was drawn with this result, not with another rig, method or content."""
        try:
            drawn = (self.folder / f"{key}{_FIGURE}").read_text(encoding="utf-8")
            return hashlib.sha256(figure.read_bytes()).hexdigest() == drawn
        except (OSError, ValueError):
            return False
