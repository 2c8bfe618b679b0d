"""Text for messages: the command that a user is told to type."""

import sys

import pytest

from bayes_tyre.plain_text import command_line, number_in


@pytest.mark.parametrize("on_path", [True, False])
def test_a_command_is_named_as_the_user_can_type_it(on_path, monkeypatch, tmp_path):
    program = tmp_path / "a bin" / "bayes-tyre"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent if on_path else tmp_path))
    monkeypatch.setattr(sys, "argv", [str(program), "fit"])
    assert command_line("report", "a b") == f"{'bayes-tyre' if on_path else repr(str(program))} report 'a b'"


def test_another_program_names_the_command_by_its_name(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/usr/bin/python"])
    assert command_line("show", "results") == "bayes-tyre show results"


@pytest.mark.parametrize(
    ("text", "number"),
    [("1.5", 1.5), (" 1e3 ", 1000.0), (b"-2", -2.0), ("1_5", None), ("\u0663", None), ("", None), (b"1_5", None)],
)
def test_a_number_is_one_as_it_is_written_everywhere(text, number):
    assert number_in(text) == number
