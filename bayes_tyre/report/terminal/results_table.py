"""The short table that a run ends with: k, beta and more by configuration and direction, and how far to trust them."""

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.plain_text import command_line, one_line, path_text
from bayes_tyre.report.answer.caveats import caveats_of
from bayes_tyre.report.answer.headline import headline, small
from bayes_tyre.report.answer.load import Reported, read_reported
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.answer.ratios import UNLIKE_CASES, unlike_cases
from bayes_tyre.report.terminal.console import LoggedConsole, print_lines, table_of
from bayes_tyre.report.terminal.fits_table import print_fits
from bayes_tyre.results.separate_fits import FitTable, read_separate_fits

#: What each kind of data means for a reader who sees nothing but the table.
WHAT_IT_IS = {
    "published": "published tables: printed numbers",
    "reconstructed": "reconstructed records: not measured",
    "simulated": "simulated records: not measured",
}
PARAMETERS = ("k_mean", "x_mean", "beta_mean", "m_mean", "c_mean", "energy_per_cycle_mean")
NUMBERS = ("median", "lower", "upper", "interval")
COLUMNS = ("parameter", "configuration", "direction", "unit", *NUMBERS, "verdict")
#: The most of a limitation: three labels are in it; and the most limitations, those that follow stay in their file.
LONGEST_LIMITATION, MOST_NOTES = 600, 3
_UNBELIEVED, _FURTHER = "not to be believed: ", "; {} more in the report"
#: Of the report's typography what a terminal may not have.
_ASCII = str.maketrans({"\N{NO-BREAK SPACE}": " ", "\N{MINUS SIGN}": "-", "\u201c": '"', "\u201d": '"'})


def overview_rows(folder: Path) -> pd.DataFrame:
    """Return the rows of `k_mean` and `beta_mean` in a result's `summary.csv`, with what kind of `data` they rest on.

    Raises
    ------
    BadInput
        If the folder holds no finished result, or a `summary.csv` that `fit` did not write.
    """
    if not (folder / "run.json").is_file():
        raise BadInput(
            f"{folder}: holds no run.json, so no finished result; name a folder that a command wrote with --out"
        )
    try:
        origin = str(read_json(folder / "run.json")["origin"])
    except (ValueError, KeyError, TypeError):
        raise BadInput(f"{folder / 'run.json'}: is not what fit writes; run fit again") from None
    return _means(folder / "summary.csv", origin)


def _means(path: Path, origin: str) -> pd.DataFrame:
    table = read_table(path)
    missing = [column for column in COLUMNS if column not in table]
    if missing:
        raise BadInput(f"{path}: is not what fit writes: no column {missing[0]}; run fit again")
    means = table[table["parameter"].isin(PARAMETERS)]
    numeric = all(pd.api.types.is_numeric_dtype(means[column]) for column in NUMBERS)
    if means.empty or not numeric or means.duplicated(["parameter", "direction", "configuration"]).any():
        raise BadInput(f"{path}: is not what fit writes: no numbers of k_mean and beta_mean; run fit again")
    return means.assign(data=WHAT_IT_IS.get(origin, origin)).reset_index(drop=True)


def print_overview(folders: list[Path], console: Console | None = None, reference: str | None = None) -> None:
    """Print the answer, a table, what not to believe and where the files are, of each folder with a posterior.

    Of `lsq` and `load-deflection` the tables as they are. Configurations stand side by side where the terminal is wide
    enough for all their figures, else below each other. `reference` is the configuration that others are compared with.
    """
    read = [read_separate_fits(folder) or overview_rows(folder) for folder in folders]
    reported = [_reported(folder, rows, reference) for folder, rows in zip(folders, read, strict=True)]
    console = console or LoggedConsole()
    for folder, rows, result in zip(folders, read, reported, strict=True):
        if isinstance(rows, list):
            print_fits(rows, folder, console)
            continue
        _print_answer(folder, rows, result, console)
        follows = command_line("report", path_text(folder))
        print_lines([f"files: {one_line(folder, None)}", f"next: {one_line(follows, None)}"], console)


def print_answer(folder: Path, run: dict[str, Any]) -> None:
    """Print the answer of a fit whose tables have just been written; `run`: what its `run.json` will hold."""
    _print_answer(folder, _means(folder / "summary.csv", run["origin"]), _answerable(folder, run), LoggedConsole())


def _print_answer(folder: Path, rows: pd.DataFrame, result: Reported | None, console: Console) -> None:
    level, verdict = float(rows["interval"].iloc[0]), rows["verdict"].iloc[0]
    about = one_line(f"{rows['data'].iloc[0]}; verdict: {verdict}", 200)
    console.print()
    console.print(Text(about))
    sentences = headline(result) if result else ()
    print_lines([_wrapped(_plain(sentence), console.width) for sentence in sentences], console)
    console.print(Text(f"mean over the cases, median and {100 * level:g} % interval"))
    if result and unlike_cases(result):
        print_lines([_wrapped(UNLIKE_CASES, console.width)], console)
    beside = _beside(rows)
    if Measurement.get(console, console.options.update(width=10**6), beside).maximum <= console.width:
        console.print(beside)
    else:
        print_lines([f"\n{_below(rows)}\n"], console)
    print_lines(_warnings(folder, result, console.width), console)


def _reported(folder: Path, rows: list[FitTable] | pd.DataFrame, reference: str | None) -> Reported | None:
    """Return a result as its sentences need it; None where it has no posterior, or a table of it failed."""
    result = None if isinstance(rows, list) else _answerable(folder)
    return result and result.referred_to(reference)


def _answerable(folder: Path, run: dict[str, Any] | None = None) -> Reported | None:
    try:
        return read_reported(folder, folder.name, run)
    except BadInput:
        return None


def _plain(text: str) -> str:
    """Return text of the report as a terminal of any character set shows it."""
    return text.translate(_ASCII)


def _wrapped(text: str, width: int) -> str:
    return "\n".join(textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False))


def _warnings(folder: Path, result: Reported | None, width: int) -> Iterator[str]:
    """Yield what not to believe, within two lines, and the first limitations of the fit."""
    whats = [_plain(caveat.what) for caveat in caveats_of(result)] if result else []
    if whats:
        room, shown = 2 * width - len(_UNBELIEVED) - len(_FURTHER.format(len(whats))), 1
        while shown < len(whats) and len("; ".join(whats[: shown + 1])) <= room:
            shown += 1
        further = _FURTHER.format(len(whats) - shown) if shown < len(whats) else ""
        text = f"{_UNBELIEVED}{'; '.join(small(what) for what in whats[:shown])}{further}"
        yield _wrapped(text, width)
    notes = limitations(folder)
    for note in notes[:MOST_NOTES]:
        yield f"note: {one_line(in_words(note), LONGEST_LIMITATION)}"
    if len(notes) > MOST_NOTES:
        yield f"note: {len(notes) - MOST_NOTES} more in {one_line(folder / 'diagnostics.json', None)}"


def limitations(folder: Path) -> list[str]:
    """Return the limitations in a result's `diagnostics.json`: what is weakly identified; none where it has none."""
    try:
        limitations = read_json(folder / "diagnostics.json")["limitations"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [each for each in limitations if isinstance(each, str)] if isinstance(limitations, list) else []


def _beside(rows: pd.DataFrame) -> Table:
    """Return one result as a table, a column a configuration; labels from files go in as text, never as markup."""
    configurations = sorted(rows["configuration"].astype(str).unique(), reverse=True)
    lines = []
    for name, block in _blocks(rows):
        by_label = block.set_index(block["configuration"].astype(str))
        cells = [_figures(by_label.loc[label]) if label in by_label.index else "" for label in configurations]
        lines.append([name, *cells])
    return table_of([(one_line(name), {}) for name in ("", *configurations)], lines)


def _below(rows: pd.DataFrame) -> str:
    """Return one result as lines, a configuration below the other."""
    lines = []
    for name, block in _blocks(rows):
        block = block.set_index(block["configuration"].astype(str)).sort_index(ascending=False)
        widest = max(cell_len(one_line(label)) for label in block.index)
        lines.append(f"  {name}")
        for label, row in block.iterrows():
            lines.append(f"    {one_line(label)}{' ' * (widest - cell_len(one_line(label)))}   {_figures(row)}")
    return "\n".join(lines)


def _blocks(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the rows of each parameter and direction, and what to call them."""
    for parameter in PARAMETERS:
        of_parameter = rows[rows["parameter"] == parameter]
        for direction, block in of_parameter.groupby(of_parameter["direction"].astype(str)):
            yield one_line(f"{parameter.removesuffix('_mean')}, {block['unit'].iloc[0]} {direction}"), block


def _figures(row: pd.Series) -> str:
    return f"{row['median']:.4g} [{row['lower']:.4g}, {row['upper']:.4g}]"
