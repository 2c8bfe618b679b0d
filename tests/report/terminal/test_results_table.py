"""The short table: it fits the terminal, shows labels as text, and refuses what `fit` did not write."""

import io
import json
from pathlib import Path

import pandas as pd
import pytest
from helpers.reported_results import write_made
from rich.console import Console

from bayes_tyre.errors import BadInput
from bayes_tyre.report.terminal.results_table import overview_rows, print_overview

TITLE = "simulated records: not measured; verdict: pass"
ABOUT = "mean over the cases, median and 95 % interval"


def summary(*configurations: str, directions: tuple[str, ...] = ("loading", "unloading")) -> pd.DataFrame:
    rows = [
        (parameter, configuration, direction, unit, 1.5 + i, 1.25 + i, 1.75 + i, 0.95, "pass")
        for parameter, unit in (("k_mean", "kN/mm"), ("beta_mean", "mm"), ("sigma_typical", "kN"))
        for direction in directions
        for i, configuration in enumerate(configurations)
    ]
    columns = ["parameter", "configuration", "direction", "unit", "median", "lower", "upper", "interval", "verdict"]
    return pd.DataFrame(rows, columns=columns)


def result(folder: Path, table: pd.DataFrame, origin: str = "simulated") -> Path:
    folder.mkdir(exist_ok=True)
    table.to_csv(folder / "summary.csv", index=False)
    (folder / "run.json").write_text(json.dumps({"origin": origin}), encoding="utf-8")
    return folder


def printed(*folders: Path, width: int = 80) -> list[str]:
    stream = io.StringIO()
    print_overview(list(folders), Console(file=stream, width=width, force_terminal=False))
    return [line.rstrip() for line in stream.getvalue().splitlines()]


def test_configurations_stand_side_by_side_where_there_is_room(tmp_path):
    folder = result(tmp_path / "fit", summary("dual", "single"))
    lines = printed(folder)
    assert lines[:3] == ["", TITLE, ABOUT]
    assert lines[4].split() == ["single", "dual"]
    assert lines[6] == "  k, kN/mm loading     2.5 [2.25, 2.75]   1.5 [1.25, 1.75]"
    assert lines[-2:] == [f"files: {folder}", f"next: bayes-tyre report {folder}"]
    assert len(lines) == 13


@pytest.mark.parametrize("width", [20, 40, 50])
def test_in_a_narrow_terminal_they_stand_below_each_other_and_no_figure_is_cut_in_two(width, tmp_path):
    lines = printed(result(tmp_path / "fit", summary("dual", "single")), width=width)
    text = "\n".join(lines)
    for i, configuration in enumerate(("dual", "single")):
        assert text.count(f"    {configuration:6}   {1.5 + i:g} [{1.25 + i:g}, {1.75 + i:g}]") == 4
    assert "  k, kN/mm loading\n    single" in text
    assert " ".join(" ".join(lines).split()).startswith(f"{TITLE} {ABOUT}")
    assert all(len(line) <= width for line in lines[: lines.index("  k, kN/mm loading")])


def test_many_configurations_stand_below_each_other_in_a_wide_terminal_too(tmp_path):
    lines = printed(result(tmp_path / "fit", summary(*(f"tyre {i}" for i in range(9)))), width=80)
    assert sum(line.startswith("    tyre ") for line in lines) == 36
    assert max(map(len, lines[:-2])) <= 80


def test_the_title_is_no_wider_than_the_terminal_and_no_narrower_than_it_has_to(tmp_path):
    one = summary("x", directions=("loading",))
    assert printed(result(tmp_path / "fit", one))[1:3] == [TITLE, ABOUT]


@pytest.mark.parametrize(
    ("label", "shown"),
    [
        ("[red]x[/red]", "[red]x[/red]"),
        ("[/]", "[/]"),
        (":smile:", ":smile:"),
        ("two\nlines", "two lines"),
        ("\x1b[31mred", "\ufffd[31mred"),
        ("\u202eabc", "\ufffdabc"),
        ("$x^$", "$x^$"),
        ("x" * 10_000, "x" * 29 + "…"),
        ("=cmd()", "=cmd()"),
    ],
)
@pytest.mark.parametrize("width", [80, 30])
def test_labels_are_shown_as_text(label, shown, width, tmp_path):
    folder = result(tmp_path / "fit", summary(label), origin=label)
    lines = printed(folder, width=width)
    assert "\n".join(lines).replace("\n", "").isprintable()
    assert any(line.strip().startswith(shown) for line in lines[3:])
    assert not any(label * 2 in line for line in lines)


def test_warnings_stand_below_the_table_in_one_line_each(tmp_path):
    folder = result(tmp_path / "fit", summary("single"))
    said = {"limitations": ["beta_case[x]: weakly identified; \x1b[31mmeasure", 3]}
    (folder / "diagnostics.json").write_text(json.dumps(said), encoding="utf-8")
    lines = printed(folder, width=40)
    assert lines[-3:-1] == [
        "note: characteristic deflection beta of x: weakly identified; \ufffd[31mmeasure",
        f"files: {folder}",
    ]


def test_of_many_warnings_three_are_printed_and_the_others_are_in_their_file(tmp_path):
    folder = result(tmp_path / "fit", summary("single"))
    content = {"limitations": [f"rho_case[{i}]: weakly identified" for i in range(5)]}
    (folder / "diagnostics.json").write_text(json.dumps(content), encoding="utf-8")
    notes = [line for line in printed(folder) if line.startswith("note: ")]
    assert notes[2:] == [
        "note: correlation rho of the noise of 2: weakly identified",
        f"note: 2 more in {folder / 'diagnostics.json'}",
    ]


def test_the_answer_stands_above_the_table_and_what_not_to_believe_below_within_two_lines(tmp_path):
    folder = write_made(tmp_path / "fit", {"single": 1.5, "dual": 2.0}, origin="reconstructed")
    lines = printed(folder)
    assert lines[1] == "reconstructed records: not measured; verdict: pass"
    assert lines[2].startswith("Configuration dual is 33 % stiffer than single, averaged over the 4 test cases")
    assert "Loading against unloading: over the same span of load" in "\n".join(lines[: lines.index(ABOUT)])
    doubts = lines[[line.startswith("not to be believed: ") for line in lines].index(True) : -2]
    assert doubts[0].startswith("not to be believed: these intervals as those of a measurement; that no record")
    assert len(doubts) <= 2
    assert all(len(line) <= 80 for line in lines[:-2])


def test_a_reference_turns_the_sentence_and_an_unknown_one_is_refused(tmp_path):
    folder = write_made(tmp_path / "fit", {"single": 1.5, "dual": 2.0})
    stream = io.StringIO()
    print_overview([folder], Console(file=stream, width=300), reference="dual")
    assert "Configuration single is 25 % softer than dual" in stream.getvalue()
    with pytest.raises(BadInput, match="--reference 'triple': no such configuration; the data have 'dual', 'single'"):
        print_overview([folder], Console(file=stream), reference="triple")


@pytest.mark.parametrize("content", ["", "{", "[]", '{"limitations": 3}', '{"limitations": {"a": 1}}', "{}"])
def test_a_folder_whose_diagnostics_say_nothing_is_shown_without_warnings(content, tmp_path):
    folder = result(tmp_path / "fit", summary("single"))
    (folder / "diagnostics.json").write_text(content, encoding="utf-8")
    assert not any(line.startswith("note:") for line in printed(folder))


def test_a_folder_s_name_is_shown_as_it_is(tmp_path):
    folder = result(tmp_path / "[red]:smile:", summary("single"))
    assert printed(folder, width=20)[-2:] == [f"files: {folder}", f"next: bayes-tyre report '{folder}'"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.drop(columns="interval"), "no column interval"),
        (lambda t: t[["median"]], "no column parameter"),
        (lambda t: t[t["parameter"] == "sigma_typical"], "no numbers of k_mean and beta_mean"),
        (lambda t: t.astype({"median": object}).assign(median="much"), "no numbers of k_mean and beta_mean"),
        (lambda t: pd.concat([t, t]), "no numbers of k_mean and beta_mean"),
    ],
)
def test_a_summary_of_another_program_is_refused(change, said, tmp_path):
    folder = result(tmp_path / "fit", change(summary("dual", "single")))
    with pytest.raises(BadInput, match=rf"summary\.csv: is not what fit writes: {said}; run fit again"):
        overview_rows(folder)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"null", b'{"origi', b"\xff", b"[" * 100_000])
def test_a_run_json_that_is_none_is_refused(content, tmp_path):
    folder = result(tmp_path / "fit", summary("single"))
    (folder / "run.json").write_bytes(content)
    with pytest.raises(BadInput, match=r"run\.json: is not what fit writes; run fit again"):
        overview_rows(folder)


def test_nothing_is_printed_where_one_of_several_is_no_result(tmp_path):
    stream = io.StringIO()
    with pytest.raises(BadInput, match=r"holds no run\.json"):
        print_overview([result(tmp_path / "fit", summary("single")), tmp_path / "none"], Console(file=stream))
    assert stream.getvalue() == ""
