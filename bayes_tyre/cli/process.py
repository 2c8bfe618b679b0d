"""`process`: raw files to records."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.shell import NoSeed, Quiet, progress, say, warn


class Method(StrEnum):
    """How raw signals become a record."""

    INERTIA = "inertia"
    THESIS = "thesis"


def process(
    raw: Annotated[
        list[Path],
        typer.Argument(metavar="RAW...", help="Raw files (.lvm, .tdms, .xlsx, .csv, .parquet), or folders of them."),
    ],
    out: Annotated[Path, typer.Option(help="Record table to write (.csv or .parquet); rejected.csv goes beside it.")],
    method: Annotated[
        Method,
        typer.Option(
            help="inertia: unsmoothed, applied load less m d''; thesis: the source's smoothing, for comparison."
        ),
    ] = Method.INERTIA,
    rig: Annotated[
        str | None, typer.Option(help="Rig: single, dual, or a TOML file; default: the one the configuration names.")
    ] = None,
    cases: Annotated[
        Path | None,
        typer.Option(
            help="Table (.csv, .parquet) with file, configuration, speed_km_h, initial_load_kN, step_kN, repeat; "
            "default: from names such as DynamicS(0)30-20(1).lvm."
        ),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for a picture a record: raw channels, step found, resulting path.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Scheduler of a dask cluster, such as tcp://host:8786, to work there instead of here; its workers "
            "must see the raw files under the same paths.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Do only what is missing or has changed since the last run with the same --out."),
    ] = False,
    seed: NoSeed = 0,
    quiet: Quiet = False,
) -> None:
    """Turn raw files into records: displacement and force on flat ground (mm, kN), from the step to the first reversal.

    Writes the record table (record, words, time_s, displacement_mm, force_kN, their standard deviations, mass_kg, how
    clear the step is) and rejected.csv: file, reason. With no usable file only the latter, and exit 3. What is done is
    kept, file by file, in a folder beside the table (.records.csv.parts), from which --resume goes on.

    Example: bayes-tyre process data/raw --method inertia --out results/records.csv --figures results/pictures
    """
    del seed
    from bayes_tyre.formats.raw import raw_files
    from bayes_tyre.workflow.process import REJECTED, Machines, Settings, process_files

    if cluster is not None and workers is not None:
        raise typer.BadParameter("goes with no --workers: the cluster has its own", param_hint="--cluster")
    files, passed_over = raw_files(raw)
    settings = Settings(rig, cases, method.value, figures)
    with progress("process", len(files), quiet) as advance:
        records, rejected = process_files(files, settings, Machines(workers, cluster, resume), out, advance)
    for remark in passed_over:
        warn(remark)
    say(f"wrote {out} and {out.parent / REJECTED} (method {method.value})", quiet)
    say(f"{records} records, {rejected} rejected", quiet)
