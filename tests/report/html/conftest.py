"""Results that several files of the page share; nothing may be written into their folders."""

from pathlib import Path

import pytest
from helpers.hand_made_posteriors import grid
from helpers.reported_results import IMAGE, SCRIPT, made

from bayes_tyre.report.answer.load import Reported


@pytest.fixture(scope="session")
def away(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="session")
def two(away) -> Reported:
    return made(away / "two", {"single": 1.5, "dual": 2.0}, repeats=3)


@pytest.fixture(scope="session")
def hostile(away) -> Reported:
    factor_table = grid((SCRIPT, "single"), 1)
    factor_table.loc[0, "record"] = IMAGE
    return made(away / "hostile", {SCRIPT: 2.0, "single": 1.5}, factor_table=factor_table, verdict="fail")
