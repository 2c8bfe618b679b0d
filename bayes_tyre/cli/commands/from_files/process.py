"""`process`: records from raw files."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from bayes_tyre.cli.raw import CasesTable, Cluster, RawFiles, RigName, Workers, check_machines
from bayes_tyre.cli.shell import Quiet, progress, say, warn


def process(
    raw: RawFiles,
    out: Annotated[Path, typer.Option(help="Record table to write (.csv or .parquet); rejected.csv goes beside it.")],
    method: Annotated[
        Literal["inertia", "thesis"],
        typer.Option(
            help="inertia: unsmoothed, applied load less m d''; thesis: the source's smoothing, for comparison."
        ),
    ] = "inertia",
    rig: RigName = None,
    cases: CasesTable = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for a figure a record: raw channels, detected step, resulting path.")
    ] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Do only what is missing or has changed since the last run with the same --out."),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Turn raw files into records: displacement and force on flat ground (mm, kN), from the step to the first reversal.

    Writes the record table (record, factors, time_s, displacement_mm, force_kN, their standard deviations, mass_kg, how
    clear the step is) and rejected.csv: file, reason. With no usable file only the latter, and exit 3. Finished files
    are cached in a folder beside the table (.records.csv.parts), from which --resume continues.

    Example: bayes-tyre process data/raw --method inertia --out results/records.csv --figures results/figures
    """
    from bayes_tyre.formats.recordings.raw import raw_files
    from bayes_tyre.workflow.raw.process import REJECTED, Machines, Settings, process_files
    from bayes_tyre.workflow.raw.raw_records import rejection_notes

    check_machines(workers, cluster)
    files, skipped = raw_files(raw)
    settings = Settings(rig, cases, method, figures)
    with progress("process", len(files), quiet) as advance:
        records, rejected = process_files(files, settings, Machines(workers, cluster, resume), out, advance)
    for text in [*skipped, *rejection_notes(rejected, out.parent / REJECTED)]:
        warn(text)
    say(f"wrote {out} and {out.parent / REJECTED} (method {method})", quiet)
    say(f"{records} records, {len(rejected)} rejected", quiet)
