"""LabVIEW measurement text files (`.lvm`): one header, tab separated, one X column, as in the source's appendix B1."""

from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput

COMMENT = "Comment"
_LAYOUT = {"Separator": "Tab", "Decimal_Separator": ".", "Multi_Headings": "No", "X_Columns": "One"}


def read_lvm(path: Path) -> pd.DataFrame:
    """Return the one segment of an `.lvm` file: `X_Value` (s) and a column a channel, named as in the file.

    Parameters
    ----------
    path:
        A file whose header says: tab separated, decimal point, one heading, one X column.

    Returns
    -------
    Numbers as float64 in the file's own units (blank cells are NaN); a `Comment` column stays text.

    Raises
    ------
    BadInput
        If the file is missing, no such layout, has more than one segment, or a cell is no number.
    """
    if not path.is_file():
        raise BadInput(f"{path}: no such file; check the path")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise BadInput(f"{path}: is not UTF-8 text; save it again as a tab-separated .lvm file") from None
    ends = [i for i, line in enumerate(lines) if line.split("\t")[0].strip().strip("*") == "End_of_Header"]
    if len(ends) != 2:
        raise BadInput(f"{path}: has {len(ends)} End_of_Header lines; one file header and one segment make two")
    header = dict(line.split("\t")[:2] for line in lines[: ends[0]] if "\t" in line)
    for key, wanted in _LAYOUT.items():
        if header.get(key) != wanted:
            raise BadInput(f"{path}: header {key} is {header.get(key)!r}; this reader needs {wanted!r}")
    if len(lines) < ends[1] + 3:
        raise BadInput(f"{path}: no rows below the header; the recording may have been cut short")
    return _segment(lines, ends[1] + 1, path)


def _segment(lines: list[str], names_at: int, path: Path) -> pd.DataFrame:
    names = lines[names_at].split("\t")
    if names[0] != "X_Value" or len(set(names)) < len(names):
        raise BadInput(f"{path}: line {names_at + 1}: needs X_Value and channel names, each once; found {names}")
    table: dict[str, list[str]] = {name: [] for name in names}
    for number, line in enumerate(lines[names_at + 1 :], start=names_at + 2):
        cells = line.split("\t")
        if len(cells) > len(names):
            raise BadInput(f"{path}: line {number}: {len(cells)} cells under {len(names)} columns; mend the row")
        for name, cell in zip(names, cells + [""] * (len(names) - len(cells)), strict=True):
            table[name].append(cell)
    columns = {name: cells if name == COMMENT else _numbers(cells, name, path) for name, cells in table.items()}
    return pd.DataFrame(columns)


def _numbers(cells: list[str], name: str, path: Path) -> np.ndarray:
    texts = pd.Series(cells, dtype=object)
    numbers = pd.to_numeric(texts.where(texts.str.strip() != ""), errors="coerce").to_numpy(dtype=float)
    wrong = np.flatnonzero(np.isnan(numbers) & (texts.str.strip() != "").to_numpy())
    if len(wrong):
        raise BadInput(
            f"{path}: row {wrong[0] + 1}, column {name}: {cells[wrong[0]][:40]!r} is no number; mend the cell"
        )
    return numbers
