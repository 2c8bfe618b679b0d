"""What all commands share: common options, exit codes for faults, progress bars, and the report of a verdict."""

import functools
import inspect
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from bayes_tyre.cli import logs, memory, suffixes
from bayes_tyre.cli.interrupt import ending_at_interrupt
from bayes_tyre.cli.messages import fault, one_line_each
from bayes_tyre.cli.messages import note as note  # commands import these three from here
from bayes_tyre.cli.messages import say as say
from bayes_tyre.cli.messages import warn as warn
from bayes_tyre.errors import BadInput, CutShort, out_of_memory
from bayes_tyre.formats.run_lock import sole_run
from bayes_tyre.plain_text import command_line, number_in

if TYPE_CHECKING:
    from bayes_tyre.report.terminal.progress import Stages
    from bayes_tyre.workflow.record_tables import Given

BAD_INPUT, NOT_TRUSTED = 3, 4
RESUME = "--resume"
#: Commands that can be resumed only if one of these options was given; others with --resume always can.
_RESUMABLE_ONLY_WITH = {"lsq": ("workers", "cluster", "resume")}

RECORD_TABLE = typer.Argument(
    metavar="RECORDS...",
    help=f"Record tables ({suffixes.TABLE}; FILE.xlsx#SHEET names a sheet), or folders of them: record, "
    "displacement_mm, force_kN; optional time_s, configuration, direction, speed_km_h, initial_load_kN, step_kN, "
    "repeat, origin. Other names and units: --columns.",
)
Records = Annotated[list[Path], RECORD_TABLE]
ColumnsMap = Annotated[
    Path | None,
    typer.Option(
        "--columns",
        metavar="MAP.TOML",
        help="What your tables call these columns, and their units; `bayes-tyre columns FILE` proposes a map.",
    ),
]
Out = Annotated[Path, typer.Option(help="Folder to write into; made if it is not there.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors and warnings.")]
Resume = Annotated[
    bool,
    typer.Option(RESUME, help="Continue from the last checkpoint of the same run in --out; the bytes are the same."),
]
Chains = Annotated[int, typer.Option(min=1, help="Chains, run in parallel.")]
Warmup = Annotated[
    int,
    typer.Option(
        min=1,
        help="Iterations of each chain to adapt (fit of 100 records and more: a pilot run stands for the first 500).",
    ),
]
Draws = Annotated[
    int | None,
    typer.Option(
        min=4,
        help="Iterations of each chain to keep. Default: 1500 (published: 2000; fit of 100 records and more: "
        "750), taken from up to 6000 (published: 8000) where R-hat or ESS falls short.",
        show_default=False,
    ),
]
#: Its range is that of `bayes_tyre.inference.sampling.run`, which imports JAX.
TargetAccept = Annotated[
    float | None,
    typer.Option(
        min=0.5,
        max=0.99,
        help="Mean acceptance that NUTS adapts its steps to: higher against divergences, and slower. Default: 0.65 (of "
        "motions, and where a fit integrates records out, 0.8), and a run with divergences is repeated once at 0.99.",
        show_default=False,
    ),
]
Seed = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="The same seed, data and options give the same numbers.")]
#: For commands without random numbers, so that a script may give every command the same options.
NoSeed = Annotated[int, typer.Option("--seed", min=0, help="Accepted by every command; nothing here is random.")]
Interval = Annotated[float, typer.Option(min=0.01, max=0.999, help="Probability of every interval, equal-tailed.")]

Xlsx = Annotated[
    bool, typer.Option("--xlsx", help="Write the tables as one Excel workbook too, a sheet each, numbers as numbers.")
]
LimitOption = Annotated[
    str | None,
    typer.Option(
        metavar='"k >= 1.8"',
        help="A limit on k (kN/mm), beta (mm) or what else cases have, with >= or <=: how probable it is that each "
        "case keeps it.",
    ),
]

ReferenceOption = Annotated[
    str | None,
    typer.Option(
        metavar="LABEL",
        help="Configuration that the others are compared with, below in each ratio; default: of two the later in "
        "sorted order.",
    ),
]


class Command(TyperCommand):
    """A command whose context is Typer's own class, as the annotations of commands say, not its base class."""

    context_class = typer.Context


def first_paragraph(command: Callable[..., None]) -> str:
    """Return how a list of commands describes one: without it, Click cuts the description to what fits into a line."""
    return " ".join((inspect.getdoc(command) or "").partition("\n\n")[0].split())


def guarded(command: Callable[..., None], group: str = "") -> Callable[..., None]:
    """Turn bad input and disk errors into one line on stderr and exit code 3, and print each warning in one line.

    The command, of a group such as `study`, gets the options --verbose and --log-file, and --seed if it has none.
    """
    signature, name = inspect.signature(command), f"{group} {command.__name__}".strip()

    @functools.wraps(command)
    def run(*args: Any, verbose: bool = False, log_file: Path | None = None, **kwargs: Any) -> None:
        # XLA logs that it compiles slowly on a busy machine; where memory is limited, its log may say what ended a run.
        if memory.address_space() is None:
            os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
        with logs.logging_to(verbose, log_file):
            kwargs = {option: value for option, value in kwargs.items() if option in signature.parameters}
            memory.within_limit(lambda: report_errors(*args, **kwargs), name)

    def report_errors(*args: Any, **kwargs: Any) -> None:
        try:
            with one_line_each(), ending_at_interrupt(*_resume_advice(command, kwargs)), sole_run(kwargs.get("out")):
                command(*args, **kwargs)
        except CutShort as error:
            fault("; ".join([str(error), *_resume_advice(command, kwargs)]))
            raise typer.Exit(BAD_INPUT) from None
        except BadInput as error:
            fault(memory.with_needs(error, name))
            raise typer.Exit(BAD_INPUT) from None
        except BrokenPipeError:  # the reader of the output has closed it; Typer ends silently
            raise
        except Exception as error:
            if out_of_memory(error):
                fault(memory.too_little(name))
            elif isinstance(error, OSError):
                where = f"{error.filename}: " if error.filename else ""
                fault(f"{where}{error.strerror or error}; check the path and the disk")
            else:
                raise
            raise typer.Exit(BAD_INPUT) from None

    run.__signature__ = _with_common_options(signature)  # pyright: ignore
    return run


def _with_common_options(signature: inspect.Signature) -> inspect.Signature:
    """Return a command's signature with the options that every command has."""
    options = list(signature.parameters.values())
    for parameter in options:
        for option in getattr(parameter.annotation, "__metadata__", ()):
            option.readable = False  # Typer would make an unreadable file a usage error; here it is bad input

    def new_option(name: str, annotation: object, default: object) -> inspect.Parameter:
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
        return inspect.Parameter(name, kind, default=default, annotation=annotation)

    if "seed" not in signature.parameters:
        before_quiet = next(i for i, option in enumerate(options) if option.name == "quiet")
        options.insert(before_quiet, new_option("seed", NoSeed, 0))
    log_options = new_option("verbose", logs.Verbose, False), new_option("log_file", logs.LogFile, None)
    return signature.replace(parameters=[*options, *log_options])


def _resume_advice(command: Callable[..., None], options: Mapping[str, object]) -> tuple[str, ...]:
    """Return how to resume an interrupted command; empty if it cannot be resumed."""
    needed = _RESUMABLE_ONLY_WITH.get(command.__name__, ("out",))
    if "resume" not in inspect.signature(command).parameters or not any(options.get(name) for name in needed):
        return ()
    call = command_line(*(option for option in sys.argv[1:] if option != RESUME), RESUME)
    return (f"resume with: {call}",)


def stages(quiet: bool) -> "Stages":
    """Return the progress bars of a command's stages, on stderr if that is a terminal."""
    from bayes_tyre.report.terminal.progress import Stages

    return Stages(not quiet)


@contextmanager
def progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Yield a function that advances the progress bar of a command's only stage by a number of items."""
    with stages(quiet) as bar:
        bar.begin(what, total)
        yield bar.advance


def read_records(paths: Sequence[Path], columns: Path | None) -> "Given":
    """Return the checked record table; print on stderr what was converted or left out."""
    from bayes_tyre.workflow.record_tables import read_given

    result = read_given(paths, columns)
    for text in result.notes:
        warn(text)
    return result


def assignments(options: list[str], flag: str) -> dict[str, float]:
    """Return NAME=VALUE options as a mapping; anything else is a usage error."""
    values = {}
    for option in options:
        name, equals, value = option.partition("=")
        number = number_in(value)
        if not equals or not name or number is None:
            raise typer.BadParameter(f"{option!r} is not NAME=VALUE, such as {flag} k=1.8", param_hint=flag)
        values[name] = number
    return values


def given_beside(context: typer.Context, accepted: Collection[str]) -> str:
    """Return the first option on the command line, or argument in capitals, that is not accepted; empty if all are.

    `accepted` has names of the command's parameters, such as ``target_accept``.
    """
    for option in context.command.params:
        source = context.get_parameter_source(str(option.name))
        if option.name not in accepted and source is not None and source.name == "COMMANDLINE":
            return option.opts[0] if option.opts[0].startswith("-") else str(option.name).upper()
    return ""


def checked_limit(text: str | None, among: Sequence[str] | None = None) -> str | None:
    """Return a limit as `run.json` states it; other text, or a parameter not in `among`, is a usage error."""
    from bayes_tyre.results.limits import LIMITED, parse_limit

    try:
        return None if text is None else parse_limit(text, among or LIMITED).text
    except BadInput as error:
        raise typer.BadParameter(str(error), param_hint="--limit") from None
