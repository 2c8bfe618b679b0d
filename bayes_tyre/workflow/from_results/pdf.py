"""A page printed to PDF by the browser that is there: found by PATH, run without a window."""

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import reason

#: Browsers that print without a window, as PATH names them.
BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "microsoft-edge-stable", "msedge"),
)
_OPTIONS = (
    *("--headless=new", "--disable-gpu", "--no-pdf-header-footer", "--no-first-run", "--disable-sync"),
    # The page asks nothing of a network, and the browser shall not either; containers have little shared memory.
    *("--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage"),
)
_LONGEST_S = 180


def find_browser() -> str:
    """Return the path of a browser.

    Raises
    ------
    BadInput
        If PATH has none.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise BadInput(
            f"--pdf: no browser is on PATH ({', '.join(BROWSERS[:3])}, {BROWSERS[-1]}); install Chromium, or print "
            "report.html from your own"
        )
    return browser


def printed_page(page: str, browser: str) -> bytes:
    """Return a page as PDF.

    Parameters
    ----------
    page:
        HTML that needs no other file.
    browser:
        As `find_browser` gives it.

    Raises
    ------
    BadInput
        If the browser prints nothing.
    """
    with TemporaryDirectory(prefix="bayes-tyre.", ignore_cleanup_errors=True) as name:
        html, pdf = Path(name, "report.html"), Path(name, "report.pdf")
        html.write_text(page, encoding="utf-8", errors="backslashreplace")
        output = _run(
            [browser, *_OPTIONS, *_as_root(), f"--user-data-dir={name}", f"--print-to-pdf={pdf}", html.as_uri()]
        )
        content = pdf.read_bytes() if pdf.is_file() else b""
    if not content.startswith(b"%PDF-"):
        raise BadInput(f"--pdf: {browser} printed nothing ({output}); print report.html from a browser with a window")
    return content


def _as_root() -> list[str]:
    """Return what root must say: for it Chromium has no sandbox."""
    return ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []


def _run(command: list[str]) -> str:
    """Run a browser, and return the end of what it says."""
    try:
        done = subprocess.run(command, capture_output=True, timeout=_LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return f"it took more than {_LONGEST_S} s"
    except OSError as error:
        return reason(error)
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    return reason(lines[-1] if lines else f"exit status {done.returncode}")
