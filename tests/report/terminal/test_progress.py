"""Bars of stages: on a terminal and in a notebook, and never at their end before the work is."""

import io
import logging
import sys

import pytest

from bayes_tyre.report.terminal import progress
from bayes_tyre.report.terminal.progress import Stages


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def on_terminal(monkeypatch) -> Terminal:
    """Return stderr as a terminal; pytest puts back what a fixture puts in its place."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    return stream


def test_a_terminal_shows_counts_which_are_full_at_the_end_alone(monkeypatch):
    terminal = on_terminal(monkeypatch)
    with Stages() as stages:
        stages.begin("draws", 1500)
        stages.advance(1499)
        assert stages._bar is not None
        stages._bar._bars.refresh()
        assert "1499/1500" in terminal.getvalue()
        assert "100%" not in terminal.getvalue()
    assert stages._bar is None


def test_after_the_last_count_a_stage_is_finishing_until_it_ends(monkeypatch):
    terminal = on_terminal(monkeypatch)
    with Stages() as stages:
        stages.begin("process", 2)
        for _ in range(2):
            assert "finishing" not in terminal.getvalue()
            stages.advance(1)
        stages._bar._bars.refresh()
        assert "process: finishing" in terminal.getvalue()
        stages.begin("compiling")
        stages.advance(1)  # of a stage without a number nothing is counted
        stages._bar._bars.refresh()
    assert "compiling: finishing" not in terminal.getvalue()


def test_a_stage_that_cannot_be_counted_shows_its_seconds(monkeypatch):
    terminal = on_terminal(monkeypatch)
    with Stages() as stages:
        stages.begin("compiling")
        stages._bar._bars.refresh()
    assert "compiling" in terminal.getvalue()
    assert "0:00:00" in terminal.getvalue()


@pytest.mark.parametrize("shown", [True, False])
def test_without_a_terminal_or_when_none_is_wanted_nothing_is_drawn(shown, monkeypatch):
    stream = io.StringIO() if shown else Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    with Stages(shown) as stages:
        stages.begin("draws", 10)
        stages.advance(10)
    assert stream.getvalue() == ""


def test_a_notebook_has_a_bar_of_text(monkeypatch, capsys):
    monkeypatch.setattr(progress, "_in_notebook", lambda: True)
    with Stages() as stages:
        stages.begin("warm-up", 600)
        stages.advance(300)
        stages.begin("diagnostics")
    said = capsys.readouterr().err
    assert "warm-up" in said
    assert "0/600" in said
    assert "diagnostics 00:00" in said


def test_a_shell_without_a_kernel_is_no_notebook():
    assert not progress._in_notebook()


def test_stages_are_logged_whether_shown_or_not(caplog):
    with caplog.at_level(logging.INFO, "bayes_tyre"), Stages(False) as stages:
        stages.begin("compiling")
        stages.begin("draws", 10)
    assert caplog.messages == ["compiling", "draws"]
