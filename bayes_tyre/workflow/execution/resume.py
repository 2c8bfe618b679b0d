"""Starting a run of the sampler in a folder: anew, from its checkpoints, or not at all where it is finished."""

import math
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.results.provenance import RUN_JSON, Run, difference, identity, read_run

CHECKPOINTS = ".checkpoint"


@dataclass(frozen=True)
class Callbacks:
    """Functions that a running fit calls, and when it began.

    Attributes
    ----------
    note, warn:
        Called with what it does with an earlier run in its folder; and with errors that do not end it: a line each.
    on_progress:
        Called with the number of iterations just done.
    answer:
        Called with the verdict once all tables are written; the posterior and the figures follow.
    on_stage:
        Called as a stage begins, with its name and its number of iterations, or of files; None: nothing to count.
    began:
        When the work began, by `time.monotonic`: the wall time of the run counts from then.
    """

    note: Callable[[str], None] = lambda _: None
    warn: Callable[[str], None] = lambda _: None
    on_progress: Callable[[int], None] = lambda _: None
    answer: Callable[[Diagnostics], object] = lambda _: None
    on_stage: Callable[[str, int | None], None] = lambda *_: None
    began: float = field(default_factory=time.monotonic)

    def settings(self, sampler: SamplerSettings, checkpoints: Checkpoints | None = None) -> SamplerSettings:
        """Return settings of a sampler that calls these and saves checkpoints, if there are any."""
        return replace(
            sampler, checkpoints=checkpoints, on_progress=self.on_progress, on_note=self.note, on_stage=self.on_stage
        )


def open_checkpoints(
    out: Path, run: Run, callbacks: Callbacks, resume: bool, *, overwrite: bool = False
) -> Checkpoints | Diagnostics:
    """Return the checkpoints of a run; or its verdict, where it is to be resumed and is finished.

    Parameters
    ----------
    out, run, callbacks, resume:
        The folder, the run, what to call, and whether to resume what is in the folder.
    overwrite:
        When resuming, overwrite what another run left, with a warning, instead of refusing. For a command whose
        expensive results are cached elsewhere, so that sampling again is quick.

    Raises
    ------
    BadInput
        When resuming, if the folder holds another run and it may not be overwritten.
    """
    checkpoints = Checkpoints(out / CHECKPOINTS, run.identity, callbacks.warn)
    try:
        if resume and (finished := _finished(out, run, checkpoints, callbacks.note)):
            return finished
    except BadInput as error:
        if not overwrite:
            raise
        what, _, _ = str(error).rpartition(";")  # what follows is advice for a refused run
        callbacks.warn(f"{what}: sampling starts again")
        checkpoints.clear()
        return checkpoints
    if not resume and checkpoints.exist():
        callbacks.note(f"{checkpoints.folder}: an unfinished run is overwritten; --resume would have continued it")
        checkpoints.clear()
    return checkpoints


def _finished(out: Path, run: Run, checkpoints: Checkpoints, note: Callable[[str], None]) -> Diagnostics | None:
    """Return the verdict in a folder that holds this run, finished; None where it is to be continued.

    Raises
    ------
    BadInput
        If the folder holds checkpoints, or without any a result, of another run.
    """
    result = out / RUN_JSON
    saved = checkpoints.identity_found()
    if saved is not None:
        _refuse_other(checkpoints.folder, difference(saved, run.identity))
    if result.is_file():
        earlier = read_run(result, shlex.split(run.command)[1])
        other = difference(
            identity(earlier["inputs"], earlier["options"], earlier["seed"], earlier["versions"]), run.identity
        )
        if not other:
            note(f"{out}: this run is finished; nothing is done again")
            checkpoints.clear()
            return _read_diagnostics(out)
        if saved is None:
            _refuse_other(result, other)
    if saved is None:
        note(f"{out}: no checkpoint to resume from; the run starts from the beginning")
    return None


def _refuse_other(where: Path, other: str) -> None:
    if other:
        raise BadInput(f"{where}: is of another run: {other}; give what it had, or leave out --resume to begin anew")


def _read_diagnostics(out: Path) -> Diagnostics:
    path = out / "diagnostics.json"
    try:
        stored: Any = read_json(path)
        numbers = {name: math.nan if value is None else value for name, value in stored.items()}
        sentences = {name: tuple(stored[name]) for name in ("reasons", "limitations") if name in stored}
        return Diagnostics(**{**numbers, **sentences})
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        raise BadInput(f"{path}: is not what fit writes; leave out --resume to fit anew") from None
