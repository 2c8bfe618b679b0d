"""What each command does, from files to files: the rooms put together, nothing computed here."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables import READERS, read_table, write_table
from bayes_tyre.inference.diagnostics import Diagnostics, diagnose
from bayes_tyre.inference.fit import fit_hierarchical, fit_published
from bayes_tyre.inference.record_fits import FitSettings, fit_records
from bayes_tyre.inference.sampling import SamplerSettings
from bayes_tyre.published import campaign, checks, tables
from bayes_tyre.record import check_record_table, origin_of
from bayes_tyre.report.folder import Run, begin_run, check_folder, prepare_folder, write_fit
from bayes_tyre.report.predictive import residual_autocorrelation

CAMPAIGN = "campaign/records.csv"


def write_campaign(out: Path, seed: int | None = None) -> tuple[Path, Path]:
    """Write the reconstructed campaign to `out` and its truth beside it; return both paths.

    Raises
    ------
    BadInput
        If `out` is named like no record table.
    """
    if out.suffix.lower() not in READERS:
        raise BadInput(f"--out {out}: {out.suffix or 'no suffix'} is not a table format; use {' or '.join(READERS)}")
    made = campaign.reconstruct(campaign.SEED if seed is None else seed)
    truth = out.with_name(f"{out.stem}_truth{out.suffix}")
    return write_table(made.records, out), write_table(made.truth, truth)


def fit_least_squares(
    table: pd.DataFrame, settings: FitSettings, out: Path, on_progress: Callable[[int], None]
) -> pd.DataFrame:
    """Write `least_squares.csv` into `out`; return it."""
    prepare_folder(out)
    fits = fit_records(table, settings, on_progress)
    write_table(fits, out / "least_squares.csv")
    return fits


def check_published(out: Path) -> pd.DataFrame:
    """Write `published_check.csv` into `out`; return it. The round trip goes through the embedded campaign."""
    prepare_folder(out)
    records = check_record_table(read_table(data_path(CAMPAIGN)), CAMPAIGN)
    fits = fit_records(records, FitSettings(region="thesis"))
    check = checks.published_check(campaign.case_means(fits))
    write_table(check, out / "published_check.csv")
    return check


def fit_published_tables(out: Path, settings: SamplerSettings, interval: float, command: Sequence[str]) -> Diagnostics:
    """Fit Tables 9 and 11 themselves and write the result's folder; return the verdict."""
    prepare_folder(out)
    inputs = ("published/table_09_stiffness.csv", "published/table_11_characteristic_deflection.csv")
    run = _begin(command, settings, interval, [data_path(name) for name in inputs], "published")
    printed = tables.case_means()
    tree = fit_published(printed, settings)
    diagnostics = diagnose(tree)
    write_fit(tree, diagnostics, run, out, printed=printed, interval=interval)
    return diagnostics


def fit_table(
    table: pd.DataFrame, path: Path, out: Path, settings: SamplerSettings, interval: float, command: Sequence[str]
) -> Diagnostics:
    """Fit a record table hierarchically and write the result's folder; return the verdict."""
    check_folder(out)
    run = _begin(command, settings, interval, [path], origin_of(table))
    tree = fit_hierarchical(table, settings)
    prepare_folder(out)
    diagnostics = diagnose(tree, residual_autocorrelation(tree, table))
    # Only records made from the printed tables have printed values to be held against.
    printed = tables.case_means() if origin_of(table) == "reconstructed" else None
    write_fit(tree, diagnostics, run, out, table=table, printed=printed, interval=interval)
    return diagnostics


def _begin(command: Sequence[str], settings: SamplerSettings, interval: float, inputs: list[Path], origin: str) -> Run:
    options = {"chains": settings.chains, "warmup": settings.warmup, "draws": settings.draws, "interval": interval}
    return begin_run(shlex.join(["bayes-tyre", *command]), options, settings.seed, inputs, origin)
