"""What commands that sample share: the length of their chains, their progress, their answer and their verdict."""

import functools
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from bayes_tyre.cli.messages import fault, note, say, warn
from bayes_tyre.cli.shell import NOT_TRUSTED, stages
from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import command_line, listed, path_text

if TYPE_CHECKING:
    from bayes_tyre.inference.diagnostics.verdict import Diagnostics
    from bayes_tyre.inference.sampling.run import SamplerSettings
    from bayes_tyre.report.terminal.progress import Stages
    from bayes_tyre.workflow.execution.resume import Callbacks

_CHECK_KINDS = ("sampling", "model", "data")
#: Tables of a fit that its answer is printed from.
SUMMARY, CASES = "summary.csv", "cases.csv"


def settings(
    chains: int, warmup: int, draws: int | None, seed: int, target_accept: float | None, default: int = 1500
) -> "SamplerSettings":
    """Return the sampler settings from the options; a run may be lengthened only if `--draws` is not given."""
    from bayes_tyre.inference.sampling.run import LONGEST, SamplerSettings

    n_draws, longest = (default, LONGEST) if draws is None else (draws, 1)
    return SamplerSettings(chains, warmup, n_draws, seed, target_accept=target_accept, longest=longest)


def callbacks(
    stages: "Stages", quiet: bool, began: float, answer: Callable[["Diagnostics"], object] = lambda _: None
) -> "Callbacks":
    """Return the callbacks of a fit: notes and warnings on stderr, progress bars, and the function `answer`.

    `began` is when the command began, by `time.monotonic`.
    """
    from bayes_tyre.workflow.execution.resume import Callbacks

    return Callbacks(functools.partial(note, quiet=quiet), warn, stages.advance, answer, stages.begin, began)


def fitted(
    fit: Callable[["Callbacks"], "Diagnostics"],
    out: Path,
    origin: str,
    options: Mapping[str, object],
    quiet: bool,
    limited: bool,
    began: float,
) -> None:
    """Fit, print the answer as soon as it exists, then the folder and later failed checks; code 4 unless `pass`.

    Parameters are those of `Answer`.
    """
    from bayes_tyre.report.answer.quantities import in_words

    with stages(quiet) as bars:
        answer = Answer(out, origin, options, quiet, bars, limited, began)
        diagnostics = fit(callbacks(bars, quiet, began, answer))
        printed = answer(diagnostics)
    say(f"wrote {out}: verdict {diagnostics.verdict}", quiet)
    say(f"next: {command_line('report', path_text(out))}", quiet)
    for reason in diagnostics.reasons[0 if quiet else len(printed.reasons) :]:
        fault(in_words(reason))
    if diagnostics.verdict != "pass":
        raise typer.Exit(NOT_TRUSTED)


def report_verdict(diagnostics: "Diagnostics", what: str, quiet: bool) -> None:
    """Print the verdict of a fit; failed checks go to stderr."""
    from bayes_tyre.report.answer.quantities import in_words

    say(f"{what}: verdict {diagnostics.verdict}", quiet)
    say("; ".join(_kind_summary(kind, diagnostics.checks) for kind in _CHECK_KINDS), quiet)
    for reason in diagnostics.reasons:
        fault(in_words(reason))


class Answer:
    """Prints the answer of a fit once, as soon as it exists: the verdict, what is stiffer, the means over the cases.

    Parameters
    ----------
    out, origin, options:
        The folder of its tables; the origin of the data; the options that its sentences depend on.
    quiet:
        Whether to print nothing: `fitted` then prints the failed checks, alone.
    stages:
        The progress bars; they are removed before the answer is printed.
    limited:
        Whether the cases are compared with a limit; the answer then has sentences on it.
    began:
        When the command began, by `time.monotonic`.
    """

    def __init__(
        self,
        out: Path,
        origin: str,
        options: Mapping[str, object],
        quiet: bool,
        stages: "Stages",
        limited: bool,
        began: float,
    ) -> None:
        self.out, self.quiet, self.stages, self.limited = out, quiet, stages, limited
        self.run = {"origin": origin, "options": dict(options)}
        self.began = began
        self.given: Diagnostics | None = None

    def __call__(self, diagnostics: "Diagnostics") -> "Diagnostics":
        """Print the answer on the first call only; return the diagnostics that were printed."""
        if self.given is None:
            self.given = diagnostics
            self.stages.stop()
            if not self.quiet:
                # If the output pipe is closed, the fit must still write its files; `fitted` then meets the error again.
                with suppress(OSError):
                    report_verdict(diagnostics, f"answer after {time.monotonic() - self.began:.0f} s", self.quiet)
                    self._print_tables()
        return self.given

    def _print_tables(self) -> None:
        """Print the answer from the tables on disk; the verdict names failed tables, and draws that are not finite."""
        from bayes_tyre.formats.tables.table_files import read_table
        from bayes_tyre.report.limits import MOST_SENTENCES, limit_sentences
        from bayes_tyre.report.terminal.results_table import print_answer

        if (self.out / SUMMARY).is_file():
            with suppress(BadInput):
                print_answer(self.out, self.run)
        if self.limited and (self.out / CASES).is_file():
            for sentence in limit_sentences(read_table(self.out / CASES), MOST_SENTENCES):
                say(sentence, quiet=False)


def _kind_summary(kind: str, checks: list[dict[str, Any]]) -> str:
    """Return how many checks of a kind failed, and the names of at most three."""
    of_kind = [check for check in checks if check["kind"] == kind]
    failed = [str(check["name"]) for check in of_kind if not check["passed"]]
    if not of_kind:
        return f"{kind}: not checked"
    if failed:
        return f"{kind}: {len(failed)} of {len(of_kind)} checks failed ({listed(failed, 3)})"
    unchecked = sum("not_checked" in check for check in of_kind)
    return f"{kind}: passed" + (f", {unchecked} of {len(of_kind)} not checked" if unchecked else "")
