"""The short table that a run ends with: k and beta, by configuration and direction, and how far to believe them."""

import json
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables import read_table

#: What each kind of data means for a reader who sees nothing but the table.
WHAT_IT_IS = {
    "published": "published tables (printed numbers)",
    "reconstructed": "reconstructed, not measured",
    "simulated": "simulated, not measured",
}


def overview_rows(folder: Path) -> pd.DataFrame:
    """Return the rows of `k_mean` and `beta_mean` in a result's `summary.csv`, with the folder's kind of data.

    Raises
    ------
    BadInput
        If the folder holds no result.
    """
    if not (folder / "run.json").is_file():
        raise BadInput(f"{folder}: holds no run.json, so no finished result; name a folder that fit wrote")
    origin = json.loads((folder / "run.json").read_text(encoding="utf-8"))["origin"]
    table = read_table(folder / "summary.csv")
    means = table[table["parameter"].isin(["k_mean", "beta_mean"])]
    return means.assign(data=WHAT_IT_IS.get(origin, origin), folder=str(folder))


def print_overview(folders: list[Path], console: Console | None = None) -> None:
    """Print one table over all the folders, then where their files are."""
    rows = pd.concat([overview_rows(folder) for folder in folders], ignore_index=True)
    console = console or Console()
    level = rows["interval"].iloc[0]
    table = Table(title="Mean over cases, by configuration and direction", title_justify="left")
    for column in ("data", "parameter", "unit", "direction", "configuration"):
        table.add_column(column, overflow="fold")
    for column in ("median", f"{level:.0%} interval", "verdict"):
        table.add_column(column, justify="right")
    for cells, last in _lines(rows):
        table.add_row(*cells, end_section=last)
    console.print(table)
    for folder in folders:
        console.print(f"files: {folder}", highlight=False, markup=False)


def _lines(rows: pd.DataFrame) -> Iterator[tuple[list[str], bool]]:
    """Yield the cells of each line, and whether a block of the same data and parameter ends with it."""
    blocks = rows.groupby(["folder", "parameter"], sort=False)
    for _, block in blocks:
        ordered = block.sort_values(["direction", "configuration"], ascending=[True, False])
        for i, row in enumerate(ordered.itertuples()):
            shown = [row.data, str(row.parameter).removesuffix("_mean"), row.unit, row.direction, row.configuration]
            figures = [f"{row.median:.4g}", f"{row.lower:.4g} to {row.upper:.4g}", row.verdict]
            yield [_plain(cell) for cell in (*shown, *figures)], i == len(ordered) - 1


def _plain(cell: object) -> str:
    """Return a cell as text that rich cannot take for markup."""
    return str(cell).replace("[", r"\[")
