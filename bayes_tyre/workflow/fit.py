"""A record table, or the published tables, in; a posterior's folder out."""

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder
from bayes_tyre.inference.diagnostics import Diagnostics, diagnose
from bayes_tyre.inference.fit import ModelSettings, fit_hierarchical, fit_published, used_points
from bayes_tyre.inference.sampling import SamplerSettings
from bayes_tyre.published import tables
from bayes_tyre.record_table import origin_of
from bayes_tyre.report.folder import begin_run, write_fit
from bayes_tyre.report.predictive import residual_autocorrelation


def fit_table(
    table: pd.DataFrame,
    path: Path,
    out: Path,
    settings: SamplerSettings,
    model: ModelSettings,
    interval: float,
    command: Sequence[str],
) -> Diagnostics:
    """Fit a record table hierarchically and write the result's folder; return the verdict."""
    check_folder(out)
    options = {**_sampler_options(settings), **asdict(model), "interval": interval}
    run = begin_run(shlex.join(["bayes-tyre", *command]), options, settings.seed, [path], origin_of(table))
    try:
        tree = fit_hierarchical(table, settings, model)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    prepare_folder(out)
    table = used_points(table, model.region)
    diagnostics = diagnose(tree, residual_autocorrelation(tree, table))
    # Only records made from the printed tables have printed values to be held against.
    printed = tables.case_means() if origin_of(table) == "reconstructed" else None
    write_fit(tree, diagnostics, run, out, table=table, printed=printed, interval=interval)
    return diagnostics


def fit_published_tables(out: Path, settings: SamplerSettings, interval: float, command: Sequence[str]) -> Diagnostics:
    """Fit Tables 9 and 11 themselves and write the result's folder; return the verdict."""
    prepare_folder(out)
    inputs = ("published/table_09_stiffness.csv", "published/table_11_characteristic_deflection.csv")
    options = {**_sampler_options(settings), "interval": interval}
    paths = [data_path(name) for name in inputs]
    run = begin_run(shlex.join(["bayes-tyre", *command]), options, settings.seed, paths, "published")
    printed = tables.case_means()
    tree = fit_published(printed, settings)
    diagnostics = diagnose(tree)
    write_fit(tree, diagnostics, run, out, printed=printed, interval=interval)
    return diagnostics


def _sampler_options(settings: SamplerSettings) -> dict[str, object]:
    return {"chains": settings.chains, "warmup": settings.warmup, "draws": settings.draws}
