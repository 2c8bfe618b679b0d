"""The short table that a run ends with: k and beta, by configuration and direction, and how far to believe them."""

import json
from pathlib import Path

import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables import read_table

#: What each kind of data means for a reader who sees nothing but the table.
WHAT_IT_IS = {
    "published": "published tables: printed numbers",
    "reconstructed": "reconstructed records: not measured",
    "simulated": "simulated records: not measured",
}
PARAMETERS = ("k_mean", "beta_mean")


def overview_rows(folder: Path) -> pd.DataFrame:
    """Return the rows of `k_mean` and `beta_mean` in a result's `summary.csv`, with what kind of `data` they rest on.

    Raises
    ------
    BadInput
        If the folder holds no finished result.
    """
    if not (folder / "run.json").is_file():
        raise BadInput(f"{folder}: holds no run.json, so no finished result; name a folder that fit wrote")
    try:
        origin = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["origin"])
    except (ValueError, KeyError, TypeError):
        raise BadInput(f"{folder / 'run.json'}: is not what fit writes; run fit again") from None
    table = read_table(folder / "summary.csv")
    means = table[table["parameter"].isin(PARAMETERS)]
    return means.assign(data=WHAT_IT_IS.get(origin, origin)).reset_index(drop=True)


def print_overview(folders: list[Path], console: Console | None = None) -> None:
    """Print a table for each folder, configurations side by side, and where its files are."""
    tables = [(folder, overview_rows(folder)) for folder in folders]
    console = console or Console()
    for folder, rows in tables:
        console.print()
        console.print(_table(rows))
        console.print(f"files: {folder}", highlight=False, markup=False, soft_wrap=True)


def _table(rows: pd.DataFrame) -> Table:
    """Return one result as a rich table of 80 columns; labels from files go in as text, never as markup."""
    level, verdict = float(rows["interval"].iloc[0]), rows["verdict"].iloc[0]
    title = f"{rows['data'].iloc[0]}; verdict: {verdict}\nmean over the cases, median and {100 * level:g} % interval"
    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1))
    configurations = sorted(rows["configuration"].astype(str).unique(), reverse=True)
    for column in ("", *configurations):
        table.add_column(Text(column))
    for parameter in PARAMETERS:
        block = rows[rows["parameter"] == parameter]
        for direction, of in block.groupby(block["direction"].astype(str)):
            by_label = of.set_index(of["configuration"].astype(str))
            name = f"{parameter.removesuffix('_mean')}, {of['unit'].iloc[0]} {direction}"
            cells = [_figures(by_label.loc[label]) if label in by_label.index else "" for label in configurations]
            table.add_row(*map(Text, [name, *cells]))
    return table


def _figures(row: pd.Series) -> str:
    return f"{row['median']:.4g} [{row['lower']:.4g}, {row['upper']:.4g}]"
