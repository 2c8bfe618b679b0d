"""The notebooks as committed: sources and outputs agree, every output says what its data are; and what runs them."""

import base64
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import jupytext
import nbformat
import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
SOURCES = sorted(FOLDER.glob("[0-9][0-9]_*.py"))
MOST_LINES, MOST_BYTES = 15, 400_000
#: One of these stands in, or right above, whatever shows numbers.
ORIGINS = re.compile("published|printed|reconstructed|simulated|(?<!not )measured", re.IGNORECASE)
MADE_UP = re.compile("reconstructed|simulated", re.IGNORECASE)
PATH = re.compile(r"(?<![\w.)])/(?:home|Users|root|tmp|var|opt|usr|work|mnt|private)\b|\b[A-Za-z]:\\")
TINY = """\
# %% [markdown]
# # Tiny

# %%
print("one", flush=True)
print("two")
"""


def outputs(cell: Any) -> list[str]:
    """Return each output of a cell as text: what was printed, the text beside a picture, a table."""
    said = []
    for output in cell.get("outputs", []):
        data = output.get("data", {})
        said.append("\n".join([output.get("text", ""), data.get("text/plain", ""), data.get("text/html", "")]))
    return said


def sections(notebook: Any) -> list[tuple[str, Any]]:
    """Return the cells of code, each with the text of the last cell of prose before it."""
    prose, found = "", []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            prose = cell.source
        else:
            found.append((prose, cell))
    return found


@pytest.fixture(params=SOURCES, ids=lambda path: path.stem)
def source(request) -> Path:
    return request.param


@pytest.fixture
def notebook(source) -> Any:
    return nbformat.read(source.with_suffix(".ipynb"), as_version=4)


def test_the_notebooks_are_there():
    assert {"01", "02", "03", "04", "05", "06", "07", "08"} <= {path.stem[:2] for path in SOURCES}
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == {path.stem for path in SOURCES}


def test_source_and_notebook_hold_the_same_cells(source, notebook):
    written = [(cell.cell_type, cell.source) for cell in jupytext.read(source).cells]
    assert [(cell.cell_type, cell.source) for cell in notebook.cells] == written


def test_cells_are_short_and_the_notebook_small(source, notebook):
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert len(cell.source.splitlines()) <= MOST_LINES, cell.source
    assert source.with_suffix(".ipynb").stat().st_size < MOST_BYTES


def test_every_cell_ran_in_order_without_a_fault_and_kept_nothing_of_the_machine(notebook):
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    for i, cell in enumerate(notebook.cells):
        assert cell.id == f"cell-{i:02d}"
        assert not cell.metadata
        for output in cell.get("outputs", []):
            assert output.output_type in ("stream", "display_data", "execute_result")
            assert output.get("name", "stdout") == "stdout"
        for text in outputs(cell):
            assert not PATH.search(text), text


def test_a_question_heads_every_figure_and_every_output_says_what_its_data_are(notebook):
    for prose, cell in sections(notebook):
        for output, text in zip(cell.outputs, outputs(cell), strict=True):
            if "image/png" not in output.get("data", {}):
                assert ORIGINS.search(text) or ORIGINS.search(prose), text
                continue
            assert re.match("##? .*\\?\n", prose), prose
            origin = text[text.index("data: ") :]
            assert ORIGINS.search(origin)
            # What is made up says so in the picture's own corner, and again in the prose above it.
            assert not MADE_UP.search(origin) or (MADE_UP.search(prose) and "not measured" in origin)
            assert base64.b64decode(output["data"]["image/png"]).startswith(b"\x89PNG")


def ran(*factor_table: object) -> subprocess.CompletedProcess[str]:
    """Return how a run of `run.py` ended."""
    command = [sys.executable, str(FOLDER / "run.py"), *map(str, factor_table)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_notebook_is_written_the_same_each_time_and_left_as_it_was_when_a_cell_fails(tmp_path):
    tiny = tmp_path / "07_tiny.py"
    tiny.write_text(TINY, encoding="utf-8")
    first = ran(tiny)
    assert first.returncode == 0, first.stderr
    assert re.match(r"07_tiny: \d+ s, \d+ s of CPU", first.stdout)
    written = tiny.with_suffix(".ipynb").read_bytes()
    (cell,) = [cell for cell in json.loads(written)["cells"] if cell["cell_type"] == "code"]
    assert cell["outputs"] == [{"name": "stdout", "output_type": "stream", "text": ["one\n", "two\n"]}]
    broken = tmp_path / "08_broken.py"
    broken.write_text(TINY + "\n# %%\nimport sys; print('noise', file=sys.stderr); 1 / 0\n", encoding="utf-8")
    broken.with_suffix(".ipynb").write_bytes(written)
    # The one that fails keeps no other from being run.
    again = ran(broken, tiny)
    assert again.returncode == 1
    assert "08_broken" in again.stderr
    assert "1 / 0" in again.stderr
    assert "ZeroDivisionError" in again.stderr
    assert broken.with_suffix(".ipynb").read_bytes() == tiny.with_suffix(".ipynb").read_bytes() == written
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("07_tiny.ipynb", "07_tiny.py", "08_broken.ipynb", "08_broken.py")
    ]
