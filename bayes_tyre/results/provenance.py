"""How a result came about: `run.json` written, read, and held against another run."""

import hashlib
import json
import math
import platform
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import write_text
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.workbook import split_sheet
from bayes_tyre.inference.sampling.run import SamplerRun

LIBRARIES = ("bayes-tyre", "jax", "jaxlib", "numpyro", "optimistix", "equinox", "arviz", "numpy", "pandas", "xarray")
RUN_JSON = "run.json"
_TABLES = ("options", "versions", "inputs")


@dataclass(frozen=True)
class Run:
    """How a result is made: the command, its options, the SHA-256 of each input by path, and when it began.

    Make it with `begin_run` before the work: an input may change while a fit runs.
    """

    command: str
    options: Mapping[str, object]
    seed: int
    inputs: Mapping[str, str]
    origin: str
    began: float

    @property
    def identity(self) -> dict[str, Any]:
        """What its numbers follow from: the content of the inputs, options, seed, versions."""
        return identity(self.inputs, self.options, self.seed, versions())


def begin_run(
    words: Sequence[str],
    options: Mapping[str, object],
    seed: int,
    inputs: Sequence[Path],
    origin: str,
    began: float | None = None,
) -> Run:
    """Return the run of ``bayes-tyre`` and these words, its inputs hashed as they are now.

    `began` is when it began, by `time.monotonic`; None: now.
    """
    command, hashes = shlex.join(["bayes-tyre", *words]), {str(path): sha256(path) for path in inputs}
    return Run(command, options, seed, hashes, origin, time.monotonic() if began is None else began)


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file; of ``FILE.xlsx#Sheet``, that of the whole workbook."""
    return hashlib.sha256(split_sheet(path)[0].read_bytes()).hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that numbers depend on."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def identity(
    inputs: Mapping[str, str], options: Mapping[str, object], seed: int, used: Mapping[str, str]
) -> dict[str, Any]:
    """Return what the numbers of a run follow from, such as JSON can hold."""
    identity = {"inputs": dict(inputs), "options": dict(options), "seed": seed, "versions": dict(used)}
    return json.loads(json.dumps(identity))


def difference(saved: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return the first thing in which another run differs from this one, a clause; empty where nothing does.

    Inputs are compared by their content: the same file by another name is the same input.
    """
    theirs, ours = saved.get("inputs", {}), now["inputs"]
    if list(theirs.values()) != list(ours.values()):
        pairs = zip(ours, theirs.values(), strict=False)
        first = "", next(iter(theirs.values()), "")  # where one has more inputs than the other
        name, was = next((pair for pair in pairs if ours[pair[0]] != pair[1]), first)
        was, now_is = (one[:12] or "none" for one in (was, ours.get(name, "")))
        return f"input {name or ', '.join(ours)}: SHA-256 was {was}..., is {now_is}..."
    for kind in ("options", "versions"):
        one, other = saved.get(kind, {}), now[kind]
        for name in sorted({*one, *other}):
            if one.get(name) != other.get(name):
                what = f"option {name}" if kind == "options" else f"version of {name}"
                return f"{what} was {one.get(name)}, is {other.get(name)}"
    return "" if saved.get("seed") == now["seed"] else f"seed was {saved.get('seed')}, is {now['seed']}"


def share_records(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Return whether two runs, as `run.json` holds them, rest on a table or recording in common, by its content.

    Column maps, rigs and tables of cases hold no records. Sheets of a workbook are tables of their own; where a run
    names no sheet, it may have read any of them.
    """
    mine, theirs = _sheets_read(one), _sheets_read(other)
    return any(
        None in mine[digest] | theirs[digest] or mine[digest] & theirs[digest] for digest in mine.keys() & theirs.keys()
    )


def _sheets_read(run: Mapping[str, Any]) -> dict[str, set[str | None]]:
    """Return which sheets were read of each input of records, by its SHA-256; None: the file, or no named sheet."""
    options, inputs = run["options"], list(run["inputs"].items())
    if options.get("columns") is not None:
        inputs = inputs[:-1]  # the column map is the last input
    beside = [options.get("rig"), options.get("cases"), *options.get("rig_files", [])]
    named = {str(Path(str(name))) for name in beside if name is not None}
    sheets: dict[str, set[str | None]] = {}
    for name, digest in inputs:
        path, sheet = split_sheet(Path(name))
        if name not in named and path.suffix.lower() != ".toml":  # rigs of rows, of a run before `rig_files`
            sheets.setdefault(str(digest), set()).add(sheet)
    return sheets


def read_run(path: Path, by: str = "fit", otherwise: str = "run that command again") -> dict[str, Any]:
    """Return what the `run.json` of a command holds.

    `otherwise` is what to do with that of another command.

    Raises
    ------
    BadInput
        If it is missing, or no `run.json` of that command.
    """
    if not path.is_file():
        raise BadInput(f"{path}: no such file; name the run.json in a folder that {by} wrote")
    try:
        run = read_json(path)
        command = shlex.split(run["command"])[1]
        complete = all(isinstance(run[name], dict) for name in _TABLES) and isinstance(run["seed"], int)
    except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError):
        command, complete = "", False
    if not complete:
        raise BadInput(f"{path}: is not what {by} writes; name the run.json in a folder that {by} wrote")
    if command != by:
        raise BadInput(f"{path}: was written by {command!r}, not by {by}; {otherwise}")
    return run


def write_json(content: Mapping[str, object], path: Path) -> None:
    """Write a mapping as JSON; what is not a number becomes null, which every reader takes."""
    write_text(json.dumps(_of_json(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n", path)


def _of_json(value: object) -> object:
    """Return a value with None in place of floats that are no number, however deep."""
    if isinstance(value, Mapping):
        return {key: _of_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_of_json(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_run(run: Run, out: Path, sampler_runs: Sequence[SamplerRun] = (), device: str = "cpu") -> None:
    """Write `run.json`: command, options, seed, origin, versions, device, SHA-256 of inputs, wall time, NUTS runs."""
    content = {
        "command": run.command,
        "options": dict(run.options),
        "seed": run.seed,
        "origin": run.origin,
        "versions": versions(),
        "device": device,
        "inputs": dict(run.inputs),
        "wall_time_s": time.monotonic() - run.began,
        "sampler_runs": [one._asdict() for one in sampler_runs],
    }
    write_json(content, out / RUN_JSON)
