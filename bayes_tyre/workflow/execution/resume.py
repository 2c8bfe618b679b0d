"""A run of the sampler into a folder: begun, gone on with from its checkpoints, or found finished."""

import json
import math
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.results.provenance import RUN_JSON, Run, difference, identity, read_run

CHECKPOINTS = ".checkpoint"


@dataclass(frozen=True)
class Watch:
    """Who is told of a fit under way.

    Attributes
    ----------
    note, warn:
        Told what it does with an earlier run in its folder; and what went wrong without ending it: a line each.
    on_progress:
        Called with the number of iterations just done.
    """

    note: Callable[[str], None] = lambda _: None
    warn: Callable[[str], None] = lambda _: None
    on_progress: Callable[[int], None] = lambda _: None


def begin(out: Path, run: Run, watch: Watch, resume: bool, *, over: bool = False) -> Checkpoints | Diagnostics:
    """Return where a run is saved on the way; or its verdict, where it is to be gone on with and is finished.

    Parameters
    ----------
    out, run, watch, resume:
        The folder, the run, who is told, and whether to go on with what is in the folder.
    over:
        Whether, to go on, what another run left is written over with a warning: of a command that keeps its dearest
        part elsewhere, and whose draws are soon made anew.

    Raises
    ------
    BadInput
        To go on, if what is in the folder is of another run and not to be written over.
    """
    checkpoints = Checkpoints(out / CHECKPOINTS, run.identity, watch.warn)
    try:
        if resume and (finished := _finished(out, run, checkpoints, watch.note)):
            return finished
    except BadInput as error:
        if not over:
            raise
        what, _, _ = str(error).rpartition(";")  # behind it stands what would be done if it were refused
        watch.warn(f"{what}: the draws are made anew")
        checkpoints.clear()
        return checkpoints
    if not resume and checkpoints.exist():
        watch.note(f"{checkpoints.folder}: an unfinished run is overwritten; --resume would have gone on from it")
        checkpoints.clear()
    return checkpoints


def _finished(out: Path, run: Run, checkpoints: Checkpoints, note: Callable[[str], None]) -> Diagnostics | None:
    """Return the verdict in a folder that holds this very run, finished; None where it is to be gone on with.

    Raises
    ------
    BadInput
        If the folder holds checkpoints, or without any a result, of another run.
    """
    result = out / RUN_JSON
    found = checkpoints.identity_found()
    if found is not None:
        _refuse_other(checkpoints.folder, difference(found, run.identity))
    if result.is_file():
        said = read_run(result, shlex.split(run.command)[1])
        other = difference(identity(said["inputs"], said["options"], said["seed"], said["versions"]), run.identity)
        if not other:
            note(f"{out}: this run is finished; nothing is done again")
            checkpoints.clear()
            return _read_diagnostics(out)
        if found is None:
            _refuse_other(result, other)
    if found is None:
        note(f"{out}: no checkpoint to go on from; the run starts from the beginning")
    return None


def _refuse_other(where: Path, other: str) -> None:
    if other:
        raise BadInput(f"{where}: is of another run: {other}; give what it had, or leave out --resume to begin anew")


def _read_diagnostics(out: Path) -> Diagnostics:
    path = out / "diagnostics.json"
    try:
        said: Any = json.loads(path.read_text(encoding="utf-8"))
        numbers = {name: math.nan if value is None else value for name, value in said.items()}
        sentences = {name: tuple(said[name]) for name in ("reasons", "limitations") if name in said}
        return Diagnostics(**{**numbers, **sentences})
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        raise BadInput(f"{path}: is not what fit writes; leave out --resume to fit anew") from None
