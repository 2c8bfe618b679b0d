"""Limits held against results on disk."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from bayes_tyre.errors import BadInput
from bayes_tyre.report.limits import limit_sentences
from bayes_tyre.results.limits import parse_limit, with_limit
from bayes_tyre.results.summary import cases
from bayes_tyre.workflow.from_results.predict import read_posterior


def limits_of(folders: Sequence[Path], limit: str) -> Iterator[str]:
    """Yield for every case of results on disk how probable it is that it keeps a limit, a sentence each.

    Raises
    ------
    BadInput
        If a folder holds no finished result, or its cases do not have the parameter.
    """
    for folder in folders:
        path, tree, verdict = read_posterior(folder)
        try:
            table = with_limit(cases(tree, verdict), tree, parse_limit(limit))
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from None
        trust = "" if verdict == "pass" else " (verdict fail, not to be trusted)"
        yield from (f"{sentence}{trust}" for sentence in limit_sentences(table))
