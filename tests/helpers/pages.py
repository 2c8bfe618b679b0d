"""The report's page of some results, and its sentences as plain text."""

import re

from helpers.drawings import drawn

from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.html.figures import embedded_figure
from bayes_tyre.report.html.page import Part, document

NBSP = "\N{NO-BREAK SPACE}"


def page_of(*results: Reported) -> str:
    return document([Part(result, [embedded_figure("contrasts", drawn("contrasts"))]) for result in results])


def plain(text: str) -> str:
    return text.replace(NBSP, " ")


def numbers_in(sentence: str) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.\d+", sentence)]
