"""The report's page in headless Chromium, from disk: drawn, sorted, silent; at a desk and on a phone."""

import base64
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from helpers.command_line import here
from helpers.drawings import ALL, drawn
from helpers.reported_results import SCRIPT, write_fitted, write_made
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.html.fits_page import fits_document
from bayes_tyre.results.separate_fits import Column, FitTable

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
MISSING = [name for name, path in (("chromium", CHROMIUM), ("chromedriver", DRIVER)) if path is None]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}; apt-get install chromium-driver"),
]
WIDTHS = {"desk": 1280, "phone": 390}
#: Width of a page of A4 between the margins of the style sheet, 210 mm less 28 mm, in pixels of 1/96 inch.
A4_WITHIN_MARGINS = 688


def shown(result: catalogue.Result) -> tuple[str, ...]:
    return ALL if result.table is not None else ALL[:1]


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """Return a page of two results with odd names, and every figure there is, drawn of hand-made tables."""
    folder = tmp_path_factory.mktemp("browser")
    fitted = write_fitted(folder / "fit")
    other = write_made(folder / "made", {"single": 1.5, SCRIPT: 2.0}, verdict="fail")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(catalogue, "draw", lambda result, _: ((name, drawn(name)) for name in shown(result)))
        done = here("report", fitted, other)
    assert done.exit_code == 4, done.stderr
    return fitted / "report.html"


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[webdriver.Chrome]:
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    profile = tmp_path_factory.mktemp("profile")
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--user-data-dir={profile}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))  # a path given: nothing is downloaded
    yield driver
    driver.quit()


def opened(browser: webdriver.Chrome, page: Path, width: int = 1280, **media: Any) -> webdriver.Chrome:
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": [], **media})
    browser.get(page.as_uri())
    return browser


def requested(browser: webdriver.Chrome) -> list[str]:
    """Return the address of every request since the last look."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [each["params"]["request"]["url"] for each in messages if each["method"] == "Network.requestWillBeSent"]


def column(browser: webdriver.Chrome, table: int, heading: str) -> tuple[Any, int]:
    """Return the button above a column of a table, and the column's place."""
    heads = browser.find_elements(By.CSS_SELECTOR, "table.sortable")[table].find_elements(By.CSS_SELECTOR, "thead th")
    place = next(i for i, head in enumerate(heads) if heading in head.text)
    return heads[place].find_element(By.TAG_NAME, "button"), place


def values(browser: webdriver.Chrome, table: int, place: int) -> list[str]:
    script = """
const rows = document.querySelectorAll("table.sortable")[arguments[0]].tBodies[0].rows;
return Array.from(rows, (row) => row.cells[arguments[1]].dataset.value);
"""
    return browser.execute_script(script, table, place)


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
def test_no_fault_on_the_console_no_request_and_every_figure_drawn(browser, page, width):
    requested(browser)
    opened(browser, page, width)
    for image in browser.find_elements(By.TAG_NAME, "img"):
        assert image.rect["width"] > 100
        assert image.rect["height"] > 50
        assert browser.execute_script("return arguments[0].complete && arguments[0].naturalWidth > 0", image)
        assert len(image.get_attribute("alt")) > 20
    assert len(browser.find_elements(By.TAG_NAME, "img")) == len(ALL) + 1
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    addresses = requested(browser)
    assert page.as_uri() in addresses
    assert {address for address in addresses if not address.startswith("data:")} == {page.as_uri()}
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


def test_the_browser_would_have_told_of_a_request_and_the_policy_stops_it(browser, page, tmp_path):
    torn = tmp_path / "torn.html"
    text = page.read_text(encoding="utf-8").replace("</main>", '<img src="file:///nowhere.png" alt=""></main>')
    torn.write_text(text, encoding="utf-8")
    opened(browser, torn)
    said, until = [], time.monotonic() + 10.0
    while not any("nowhere.png" in text for text in said) and time.monotonic() < until:  # the log comes a moment later
        said += [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert any("nowhere.png" in text for text in said)


def test_every_figure_can_be_saved_as_the_svg_that_is_shown(browser, page, tmp_path):
    opened(browser, page)
    browser.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    links = browser.find_elements(By.CSS_SELECTOR, "figure a.save")
    assert {link.text for link in links} == {"Save as SVG"}
    assert len(links) == len(ALL) + 1
    saved, until = tmp_path / str(links[0].get_attribute("download")), time.monotonic() + 10.0
    links[0].click()
    while not saved.is_file() and time.monotonic() < until:
        time.sleep(0.05)
    assert saved.suffix == ".svg"
    shown_bytes = str(links[0].get_attribute("href")).removeprefix("data:image/svg+xml;base64,")
    assert saved.read_bytes() == base64.b64decode(shown_bytes)
    assert b"<svg" in saved.read_bytes()


def test_labels_run_no_script(browser, page):
    opened(browser, page)
    assert "alert(1)" in browser.find_element(By.TAG_NAME, "body").text
    assert len(browser.find_elements(By.TAG_NAME, "script")) == 1
    assert browser.find_elements(By.CSS_SELECTOR, "[onerror], [src=x]") == []


def test_marks_of_direction_and_characters_without_width_are_seen_as_text(browser, tmp_path):
    """The right-to-left override would show `kS` as `Sk`; a label with a space of no width would pass for another."""
    names = Column("test", "", pd.Series(["\u202eSk", "single\u200b"]), pd.Series([float("nan")] * 2), is_text=True)
    page = tmp_path / "page.html"
    page.write_text(fits_document([FitTable("tests", [names], pd.Series(["ok", "ok"]), "measured")], []), "utf-8")
    opened(browser, page)
    shown = [cell.text for cell in browser.find_elements(By.CSS_SELECTOR, "tbody td:first-child")]
    assert shown == ["\N{REPLACEMENT CHARACTER}Sk", "single\N{REPLACEMENT CHARACTER}"]
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_every_table_sorts_numbers_as_numbers_either_way_with_empty_cells_last(browser, page):
    opened(browser, page)
    tables = browser.find_elements(By.CSS_SELECTOR, "table.sortable")
    assert len(tables) >= 4
    for table in range(len(tables)):
        heads = tables[table].find_elements(By.CSS_SELECTOR, "thead th")
        for place, head in enumerate(heads):
            button = head.find_element(By.TAG_NAME, "button")
            before = sorted(values(browser, table, place))
            for way in ("ascending", "descending"):
                browser.execute_script("arguments[0].click()", button)
                assert head.get_attribute("aria-sort") == way
                found = values(browser, table, place)
                assert sorted(found) == before
                filled = [value for value in found if value]
                assert found == filled + [""] * (len(found) - len(filled))
                if head.get_attribute("data-kind") == "number":
                    numbers = [float(value) for value in filled]
                    assert numbers == sorted(numbers, reverse=way == "descending")
            others = [other.get_attribute("aria-sort") for other in heads if other != head]
            assert others == ["none"] * len(others)


def test_tables_sort_from_the_keyboard(browser, page):
    opened(browser, page)
    button, place = column(browser, 1, "k")
    button.send_keys(Keys.ENTER)
    rising = [float(value) for value in values(browser, 1, place) if value]
    button.send_keys(Keys.SPACE)
    falling = [float(value) for value in values(browser, 1, place) if value]
    assert rising == sorted(rising)
    assert falling == rising[::-1]
    assert browser.switch_to.active_element == button


def test_dark_and_print_change_the_paper_and_keep_figures_light(browser, page):
    def back(selector: str) -> str:
        script = "return getComputedStyle(document.querySelector(arguments[0])).backgroundColor"
        return browser.execute_script(script, selector)

    opened(browser, page, features=[{"name": "prefers-color-scheme", "value": "light"}])
    light = back("body")
    opened(browser, page, features=[{"name": "prefers-color-scheme", "value": "dark"}])
    assert back("body") != light
    assert back("figure") == "rgb(255, 255, 255)"
    opened(browser, page, media="print", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    assert back("body") == "rgb(255, 255, 255)"
    assert browser.execute_script("return getComputedStyle(document.querySelector('.scroll')).overflow") == "visible"


def test_on_paper_no_table_of_one_result_is_wider_than_the_page(browser, tmp_path):
    fitted = write_made(tmp_path / "made", {"315/80 R22.5 Alpha": 1.5, "315/80 R22.5 Beta": 2.0})
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(catalogue, "draw", lambda *_: iter(()))
        assert here("report", fitted).exit_code == 0
    opened(browser, fitted / "report.html", width=A4_WITHIN_MARGINS, media="print")
    assert browser.execute_script("return document.documentElement.scrollWidth") <= A4_WITHIN_MARGINS
    hint, text = (
        f"return parseFloat(getComputedStyle(document.querySelector('{one}')).fontSize)" for one in (".hint", "body")
    )
    assert browser.execute_script(hint) < browser.execute_script(text)
