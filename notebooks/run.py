"""Run notebooks from clean: each `NN_name.py` (jupytext, percent format) to its `NN_name.ipynb` with outputs.

A notebook runs in an empty folder, in a kernel of the Python that runs this. Its `.ipynb` is written whole, or left as
it was: when a cell fails, the cell and its error are printed and the exit code is 1.
"""

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import jupytext
import nbformat
from ipykernel.kernelspec import get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbformat import NotebookNode

from bayes_tyre.formats.files import write_text

HERE = Path(__file__).parent
#: The longest that one cell may take, s.
LIMIT = 600
#: What a notebook says of itself: nothing that hangs on the machine or the version of Python.
METADATA = {
    "jupytext": {"formats": "ipynb,py:percent"},
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"file_extension": ".py", "name": "python"},
}


class ThisPython(AsyncKernelManager):
    """Starts this Python's own kernel, whatever kernels the user has installed."""

    @property
    def kernel_spec(self) -> KernelSpec:
        """How to start it."""
        return KernelSpec(**get_kernel_dict())


def read(source: Path) -> NotebookNode:
    """Return a notebook without outputs, the same each time: cells are named by their place."""
    notebook = jupytext.read(source)
    notebook.metadata = nbformat.from_dict(METADATA)
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    for i, cell in enumerate(notebook.cells):
        cell.id = f"cell-{i:02d}"
        cell.metadata.pop("lines_to_next_cell", None)  # jupytext's note on blank lines in the source
    return notebook


def execute(notebook: NotebookNode, limit: float = LIMIT) -> list[str]:
    """Run the cells in an empty folder, outputs into the notebook; return what was said on stderr, which is not kept.

    Raises
    ------
    CellExecutionError, CellTimeoutError, DeadKernelError
        If a cell fails, takes longer than `limit` (s), or ends the kernel.
    """
    with tempfile.TemporaryDirectory(prefix="notebook-") as folder:
        # Neither the user's start-up files nor their drawing backend have a say.
        clean = {"IPYTHONDIR": f"{folder}/.ipython", "MPLBACKEND": "agg", "COLUMNS": "120"}
        # Progress bars ask for widgets, which a notebook without a browser has not, and nobody watches ours.
        clean |= {"PYTHONWARNINGS": "ignore:IProgress not found", "TQDM_DISABLE": "1"}
        client = NotebookClient(
            notebook,
            kernel_manager_class=ThisPython,
            timeout=int(limit),
            record_timing=False,
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": folder}},
        )
        # The kernel's folder is empty: `support` is imported from here.
        clean["PYTHONPATH"] = os.pathsep.join(filter(None, [str(HERE.resolve()), os.environ.get("PYTHONPATH")]))
        client.execute(env=os.environ | clean)
    notebook.metadata = nbformat.from_dict(METADATA)  # the kernel has added its own
    said = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            said += [output.text for output in cell.outputs if _on(output, "stderr")]
            cell.outputs = _joined([output for output in cell.outputs if not _on(output, "stderr")])
    return said


def _on(output: NotebookNode, stream: str) -> bool:
    return output.output_type == "stream" and output.name == stream


def _joined(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Return the outputs with printed text that follows printed text joined: how it was cut into pieces is chance."""
    joined: list[NotebookNode] = []
    for output in outputs:
        if joined and _on(output, "stdout") and _on(joined[-1], "stdout"):
            joined[-1].text += output.text
        else:
            joined.append(output)
    return joined


def run(source: Path, limit: float) -> bool:
    """Run one notebook and write it beside its source; print how long it took; return whether it ran through."""
    begin, used = time.perf_counter(), _cpu_s()
    notebook = read(source)
    try:
        said = execute(notebook, limit)
    except (CellExecutionError, CellTimeoutError, DeadKernelError) as error:
        print(f"{source.stem}: {error}", file=sys.stderr)
        return False
    for text in said:
        print(f"{source.stem}, stderr: {text.rstrip()}", file=sys.stderr)
    write_text(nbformat.writes(notebook) + "\n", source.with_suffix(".ipynb"))
    wall, cpu = time.perf_counter() - begin, _cpu_s() - used
    print(f"{source.stem}: {wall:.0f} s, {cpu:.0f} s of CPU", flush=True)
    return True


def _cpu_s() -> float:
    """Return the CPU time of the processes that this one has started and that have ended, s."""
    times = os.times()
    return times.children_user + times.children_system


def main() -> int:
    """Run the notebooks named, or all; return the exit code."""
    parser = argparse.ArgumentParser(description="Run notebooks from clean and keep their outputs.")
    parser.add_argument("sources", nargs="*", type=Path, help="NN_name.py; default: all beside this file")
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds that one cell may take")
    arguments = parser.parse_args()
    sources = arguments.sources or sorted(HERE.glob("[0-9][0-9]_*.py"))
    if len(sources) == 1:
        return 0 if run(sources[0], arguments.limit) else 1
    # Each in a process of its own, side by side: much of a notebook is done on one core.
    workers = min(len(sources), os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        done = list(pool.map(run, sources, repeat(arguments.limit)))
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main())
