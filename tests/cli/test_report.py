"""`report`: where the page goes, exit codes, what it draws, and results whose input is gone."""

import json
import re
import shutil
from base64 import b64encode
from html import escape
from pathlib import Path

import pytest
from helpers.command_line import assert_refused, here, small, tree_of, written
from helpers.reported_motions import write_motions
from helpers.reported_results import IMAGE, SCRIPT, printed_factors, write_fitted, write_made

from bayes_tyre.report.figures.catalogue import ALWAYS, OF_MOTIONS, OF_RECORDS
from bayes_tyre.report.html.figures import HEADINGS

# Draws every figure of a result: over 10 s for the file.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    return write_fitted(tmp_path_factory.mktemp("fitted") / "fit")


@pytest.fixture
def quick(monkeypatch) -> None:
    """Draw no figures where they are not what is tested."""
    monkeypatch.setattr("bayes_tyre.report.figures.catalogue.draw", lambda *_: iter(()))


def test_one_page_with_every_figure(fitted, tmp_path):
    before = tree_of(fitted)
    done = here("report", fitted, "--out", tmp_path / "page.html")
    verdict = json.loads((fitted / "diagnostics.json").read_text())["verdict"]
    assert (done.exit_code, verdict) in ((0, "pass"), (4, "fail")), done.stderr
    assert tree_of(fitted) == before
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == len(ALWAYS) + len(OF_RECORDS) + 1  # odd repeats
    assert "data:image/png" not in re.sub(r"base64,[^\"]*", "", page)
    assert SCRIPT not in page
    assert IMAGE not in page
    assert len(page) < 5e6


def test_a_figure_that_fails_is_named_and_the_page_has_the_others(fitted, tmp_path, monkeypatch):
    def fails(*_: object) -> None:
        raise ZeroDivisionError("nothing to draw")

    figures = {"rank_plot": fails, "forest_of_cases": ALWAYS["forest_of_cases"]}
    monkeypatch.setattr("bayes_tyre.report.figures.catalogue.ALWAYS", figures)
    monkeypatch.setattr("bayes_tyre.report.figures.catalogue.OF_RECORDS", {})
    done = here("report", fitted, "--out", tmp_path / "page.html", "--quiet")
    assert done.exit_code == 4
    assert "rank_plot.png failed: ZeroDivisionError: nothing to draw; " in done.stderr
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == 2  # odd repeats
    assert "rank_plot.png failed" in page


def test_a_result_of_motions_is_drawn_anew_and_its_energy_and_loop_with_it(tmp_path, monkeypatch):
    monkeypatch.setattr("bayes_tyre.report.figures.catalogue.ALWAYS", {})
    folder = write_motions(tmp_path / "motion", ("single",))
    done = here("report", folder)
    assert (done.exit_code, done.stderr) == (0, "")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == len({*OF_MOTIONS, "loops_by_direction"})
    assert "data:image/png" not in re.sub(r"base64,[^\"]*", "", page)
    assert "How much energy a cycle loses" in page
    assert "The loop of a cycle" in page
    assert "as the fit drew them" not in page


def test_kept_figures_are_shown_as_they_lie_there(fitted, tmp_path):
    folder = shutil.copytree(fitted, tmp_path / "fit")
    (folder / "figures").mkdir()
    for name in ("pair_plot", "contrasts", "of_my_own"):
        (folder / "figures" / f"{name}.png").write_bytes(b"\x89PNG " + name.encode())
    done = here("report", folder, "--kept-figures")
    assert done.exit_code == 4
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert 'src="data:image/svg' not in page
    headings = re.findall(r"<h3>([^<]*)</h3>", page)
    assert headings == ["Not checked", HEADINGS["contrasts"][0], HEADINGS["pair_plot"][0], "Of my own"]


@pytest.mark.parametrize("option", [("--reference", "single"), ("--kept-figures",)])
def test_options_of_a_posterior_are_refused_for_estimates(option, tmp_path):
    lsq = tmp_path / "lsq"
    assert here("lsq", written(small(), tmp_path / "records.csv"), "--out", lsq).exit_code == 0
    done = here("report", lsq, *option)
    assert_refused(done.exit_code, done.stderr, f"{lsq}: holds no posterior, which {option[0]} is of")
    assert not (lsq / "report.html").exists()


def test_figures_of_records_are_those_of_the_fit_where_its_input_is_gone(fitted, tmp_path, quick):
    folder = shutil.copytree(fitted, tmp_path / "fit")
    (folder / "figures").mkdir()
    (folder / "figures" / "records_with_bands.png").write_bytes(b"\x89PNG of the fit")
    run = json.loads((folder / "run.json").read_text())
    run["inputs"] = {"nowhere.csv": "0" * 64}
    (folder / "run.json").write_text(json.dumps(run))
    done = here("report", folder)
    assert done.exit_code == 4
    assert "nowhere.csv is not there" in done.stderr
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1
    assert "its input was not found" in page


def test_what_stands_above_the_page_is_text_and_the_logo_is_in_it(tmp_path, quick):
    logo = tmp_path / "logo"
    logo.write_bytes(b"\x89PNG\r\n\x1a\n of a lab")
    lsq = tmp_path / "lsq"
    assert here("lsq", written(small(), tmp_path / "records.csv"), "--out", lsq).exit_code == 0
    above = ("--title", SCRIPT, "--order", "A-7 & 8", "--operator", IMAGE, "--logo", logo)
    for folder in (write_made(tmp_path / "made", {"x": 1.0}), lsq):
        assert here("report", folder).exit_code == 0
        policy = re.search(r"Content-Security-Policy.*", (folder / "report.html").read_text("utf-8"))
        assert here("report", folder, *above).exit_code == 0
        page = (folder / "report.html").read_text(encoding="utf-8")
        shown, operator = (escape(text).replace("&quot;", "&#34;") for text in (SCRIPT, IMAGE))
        assert f"<title>{shown}</title>" in page
        assert f"<h1>{shown}</h1>" in page
        assert f"Order: A-7 &amp; 8 &middot; Operator: {operator}" in page
        assert SCRIPT not in page
        assert IMAGE not in page
        assert f'src="data:image/png;base64,{b64encode(logo.read_bytes()).decode()}"' in page
        assert policy is not None
        assert policy[0] in page


def test_without_a_browser_nothing_is_printed_and_nothing_written(tmp_path, monkeypatch):
    made = write_made(tmp_path / "made", {"x": 1.0})
    before = tree_of(tmp_path)
    monkeypatch.setenv("PATH", "")
    done = here("report", made, "--pdf")
    assert_refused(done.exit_code, done.stderr, "--pdf", "no browser is on PATH", "chromium", "install Chromium")
    assert tree_of(tmp_path) == before


def test_a_browser_that_prints_nothing_is_named_with_what_it_said(tmp_path, monkeypatch, quick):
    made = write_made(tmp_path / "made", {"x": 1.0}, factor_table=printed_factors("x"))
    browser = tmp_path / "bin" / "google-chrome"
    browser.parent.mkdir()
    browser.write_text("#!/bin/sh\necho no display today >&2\nexit 1\n")
    browser.chmod(0o755)
    before = tree_of(tmp_path)
    monkeypatch.setenv("PATH", str(browser.parent))
    done = here("report", made, "--pdf")
    assert_refused(done.exit_code, done.stderr, str(browser), "no display today", "print report.html")
    assert tree_of(tmp_path) == before


@pytest.mark.skipif(shutil.which("chromium") is None, reason="not installed: chromium; apt-get install chromium")
def test_the_page_is_printed_beside_it(tmp_path, quick):
    made = write_made(tmp_path / "made", {"x": 1.0}, factor_table=printed_factors("x"))
    done = here("report", made, "--pdf", "--out", tmp_path / "page.html")
    assert (done.exit_code, done.stderr) == (0, "")
    written = [tmp_path / name for name in ("page.html", "page.pdf")]
    assert done.stdout.splitlines() == [f"drawing the figures of {made}", *(f"wrote {path}" for path in written)]
    printed = (tmp_path / "page.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) > 1
    assert b"Tyre stiffness" in printed or "Tyre stiffness".encode("utf-16-be").hex().upper().encode() in printed


def test_an_older_print_goes_as_the_page_is_written_anew(tmp_path, quick):
    made = write_made(tmp_path / "made", {"x": 1.0}, factor_table=printed_factors("x"))
    (made / "report.pdf").write_bytes(b"%PDF- of an older page")
    (tmp_path / "page.pdf").write_bytes(b"%PDF- of another's")
    assert here("report", made, "--out", tmp_path / "page.html").exit_code == 0
    assert (made / "report.pdf").exists()
    assert (tmp_path / "page.pdf").exists()
    assert here("report", made).exit_code == 0
    assert not (made / "report.pdf").exists()


def test_the_page_goes_into_the_first_folder_or_where_out_says(tmp_path, quick):
    factors = printed_factors("x")
    one, two = (
        write_made(tmp_path / name, {"x": 1.0}, factor_table=factors, seed=i) for i, name in enumerate(("one", "two"))
    )
    done = here("report", one, two)
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout == "".join(
        f"{line}\n"
        for line in (f"drawing the figures of {one}", f"drawing the figures of {two}", f"wrote {one / 'report.html'}")
    )
    assert not (two / "report.html").exists()
    for out, path in (("page.html", "page.html"), ("deep/down", "deep/down/report.html")):
        assert here("report", one, "--out", tmp_path / out, "--quiet").stdout == ""
        assert (tmp_path / path).is_file()


def test_a_failed_verdict_is_written_and_ends_with_code_4(tmp_path, quick):
    factors = printed_factors("x")
    good = write_made(tmp_path / "good", {"x": 1.0}, factor_table=factors)
    bad = write_made(tmp_path / "bad", {"x": 1.0}, verdict="fail", factor_table=factors, seed=4)
    done = here("report", good, bad, "--out", tmp_path / "page.html")
    assert done.exit_code == 4
    assert done.stderr == "bayes-tyre: warning: bad: the posterior is not to be trusted; its report says why\n"
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Verdict: pass" in page
    assert "Verdict: fail" in page
    assert "Averages over the test cases" in page


def test_what_is_no_result_is_refused_and_nothing_is_written(tmp_path, quick):
    made = write_made(tmp_path / "made", {"x": 1.0})
    (tmp_path / "lsq").mkdir()
    (tmp_path / "lsq" / "least_squares.csv").write_text("record\na\n")
    before = tree_of(tmp_path)
    for given, said in (
        ([made, tmp_path / "lsq"], ["lsq", "run.json"]),
        ([made, tmp_path / "made/../made"], ["named twice"]),
        ([made, "--out", tmp_path / "page.pdf"], ["page.pdf", "HTML", "--pdf"]),
        ([made, "--logo", tmp_path / "lsq" / "least_squares.csv"], ["--logo", "is no image", "give PNG"]),
        ([made, "--logo", tmp_path / "none.png"], ["--logo", "none.png", "cannot be read"]),
    ):
        done = here("report", *given)
        assert_refused(done.exit_code, done.stderr, *said)
        assert tree_of(tmp_path) == before
