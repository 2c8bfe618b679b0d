"""`columns`: a proposed column map of a lab's table."""

from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli import suffixes
from bayes_tyre.cli.shell import Quiet, say, warn


def columns(
    table: Annotated[
        Path, typer.Argument(metavar="FILE", help=f"A table ({suffixes.TABLE}; FILE.xlsx#SHEET names a sheet).")
    ],
    out: Annotated[Path | None, typer.Option(help="Map to write (TOML); default: to the terminal.")] = None,
    quiet: Quiet = False,
) -> None:
    """Propose a column map: which columns are the record, displacement and force (mm, kN), and so on.

    Columns are placed by English and German names, by their units (N, kN, lbf, m, mm, in, s, ms) and by what the
    directions are called. What could not be placed goes to stderr, and into the map as comments: read it before use.
    Another map that is there already is kept, under its name and ".old".

    Example: bayes-tyre columns tests.xlsx --out map.toml
    """
    from bayes_tyre.formats.files import write_text
    from bayes_tyre.formats.tables.column_proposal import layout_by_vocabulary, propose
    from bayes_tyre.formats.tables.table_files import read_table
    from bayes_tyre.plain_text import command_line, path_text

    proposal = propose(read_table(table, layout_by_vocabulary()))
    for text in proposal.unplaced:
        warn(f"{table}: {text}")
    if out is None:
        say(proposal.toml.rstrip("\n"), quiet)
        return
    if out.is_file() and out.read_text(encoding="utf-8", errors="replace") != proposal.toml:
        old = out.replace(out.with_name(f"{out.name}.old"))
        warn(f"{out}: held another map, which is now {old}")
    write_text(proposal.toml, out)
    results = f"results/{proposal.command}"
    command = command_line(proposal.command, path_text(table), "--columns", path_text(out), "--out", results)
    first = f"name your columns for {', '.join(proposal.missing)} in {out}, then " if proposal.missing else ""
    say(f"wrote {out}", quiet)
    if not proposal.states_origin:
        say("no column states the origin: if these are measurements, uncomment the last two lines of the map", quiet)
    say(f"next: {first}{command}", quiet)
