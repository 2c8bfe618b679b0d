"""The public face: a whole analysis in a few calls, `import bayes_tyre as bt`.

Thin functions over the rooms below. Those that compute with JAX first switch it, as the commands do, to float64 and to
a host device for each chain; the functions they call leave JAX as they find it. A posterior that `fit` or
`read_posterior` returns carries its verdict, which then stands in every table made of it.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre import __all__ as __all__
from bayes_tyre.errors import BadInput as BadInput
from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.formats.files import check_folder
from bayes_tyre.formats.run_lock import sole_run
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.diagnostics import verdict as diagnostics
from bayes_tyre.inference.diagnostics.attempts import FAILED, Attempt, Attempts, checks_in, with_checks
from bayes_tyre.inference.diagnostics.judge import judge, with_failures
from bayes_tyre.inference.diagnostics.power_scaling import identify_published, identify_records
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.least_squares import table as record_fits
from bayes_tyre.inference.least_squares.table import FitSettings
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import prepare_records, used_points
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import model_of
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical, without_effect
from bayes_tyre.inference.sampling.hierarchical_fit import fit_published as fit_printed_means
from bayes_tyre.inference.sampling.run import LONGEST, SamplerSettings
from bayes_tyre.laws import fancher
from bayes_tyre.published import campaign, tables
from bayes_tyre.published.campaign import Reconstruction
from bayes_tyre.record_table import check_record_table, suspicious_units
from bayes_tyre.report.figures.catalogue import Result, chosen_figure
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure
from bayes_tyre.report.terminal.progress import Stages
from bayes_tyre.results import contrasts as ratios
from bayes_tyre.results import prediction, summary
from bayes_tyre.results.cases.selection import parse_query
from bayes_tyre.results.cases.stacked import Weighted
from bayes_tyre.results.comparison import log_likelihood
from bayes_tyre.results.derived import with_derived
from bayes_tyre.results.fitted_records import fitted_records
from bayes_tyre.results.posterior import Posterior
from bayes_tyre.results.prediction import Prediction
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.workflow.execution.resume import Callbacks
from bayes_tyre.workflow.fit import Plan, fit_table
from bayes_tyre.workflow.from_results.predict import read_result
from bayes_tyre.workflow.record_tables import read_given

#: Host devices, fixed when JAX starts: enough for the chains of a fit that may come after.
_DEVICES = SamplerSettings().chains


def read_records(*paths: str | Path, columns: str | Path | None = None) -> pd.DataFrame:
    """Return the record table in files and folders, checked: mm, kN, a row a point.

    Parameters
    ----------
    paths:
        `.csv`, `.parquet`, `.xlsx`, `.mat` or `.tdx` files, or folders of them.
    columns:
        A column map in TOML, of other names and units; what a file's own row of units converts is warned of.

    Raises
    ------
    BadInput
        For a file that cannot be read, and for cells, factors or columns that cannot be right.
    """
    given = read_given([*map(Path, paths)], None if columns is None else Path(columns))
    for note in given.notes:
        warnings.warn(note, stacklevel=2)
    return given.table


def reconstruct_campaign() -> Reconstruction:
    """Return the records reconstructed from the published tables, and their truth: made up, nothing was measured.

    Examples
    --------
    >>> import bayes_tyre as bt
    >>> len(bt.reconstruct_campaign().truth)
    144
    """
    prepare_jax(_DEVICES)
    return campaign.reconstruct()


def fit_least_squares(
    records: pd.DataFrame, settings: FitSettings | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> pd.DataFrame:
    """Return Equation 2 fitted to each record by itself, a row a record.

    Parameters
    ----------
    records:
        A record table; it is checked.
    settings:
        What to fit; by default k (kN/mm), C (kN) and beta (mm) over all points.
    on_progress:
        Called with the number of records just done.

    Returns
    -------
    pandas.DataFrame
        The columns of `least_squares.csv`.

    Raises
    ------
    BadInput
        For a record table that cannot be right. Units that look wrong are warned of.
    """
    prepare_jax(_DEVICES)
    table = check_record_table(records)
    for suspicion in suspicious_units(table):
        warnings.warn(suspicion, stacklevel=2)
    return record_fits.fit_records(table, settings, on_progress)


def fit(
    records: pd.DataFrame,
    settings: SamplerSettings | None = None,
    model: ModelSettings | None = None,
    priors: Mapping[str, object] | None = None,
    *,
    chains: int | None = None,
    warmup: int | None = None,
    draws: int | None = None,
    seed: int | None = None,
    units_checked: bool = False,
    progress: bool = True,
    out: str | Path | None = None,
) -> Posterior:
    """Return the posterior of all records together, by NUTS, with its verdict.

    Parameters
    ----------
    records:
        A record table; it is checked.
    settings:
        How much to sample; by default 1,500 draws a chain (750 of 100 records and more), taken from up to 6,000
        where they are needed.
    model:
        Options of the model: `ModelSettings(repeats="student")`.
    priors:
        Changes of the default priors: ``{"k_group": {"median": 1.8, "sd_log": 0.3}, "discordant_widening": 8.0}``; the
        names and units are those of `docs/reference/priors.md`.
    chains, warmup, draws, seed:
        In place of those of `settings`.
    units_checked:
        Whether you vouch for units that look wrong, such as forces in N.
    progress:
        Whether to show how far each stage is, in a notebook or on a terminal.
    out:
        Folder to write the result into, as `bayes-tyre fit` does, and the records as `records.csv`; the commands
        (`report`, `show`, `export` and the others) then take it. None: nothing is written.

    Returns
    -------
    Posterior
        A `xarray.DataTree` that shows itself as its table and verdict: ArviZ's groups `posterior` and `sample_stats`,
        dims and units named; `derived`: means over cases and average ratios, as they are printed; `identifiability`:
        what decides each quantity. `attrs["verdict"]` is ``pass`` or ``fail``, and `diagnose` says why.

    Raises
    ------
    BadInput
        For a record table that cannot be right or whose units look wrong, and for a record that cannot be fitted: none
        is dropped.

    Warns
    -----
    UserWarning
        Where the verdict is ``fail``, and without `out` for a prior of a quantity that these records' model has not.
    """
    if not isinstance(settings, SamplerSettings | None):
        raise BadInput("the second argument is how much to sample; options of the model go by name: model=...")
    given = {"chains": chains, "warmup": warmup, "draws": draws, "seed": seed}
    default = settings is None and draws is None
    settings = settings or SamplerSettings(longest=LONGEST if default else 1)
    settings = replace(settings, **{name: value for name, value in given.items() if value is not None})
    model = _with_priors(model, priors)
    table = check_record_table(records)
    if not units_checked and (suspicions := suspicious_units(table)):
        raise BadInput(f"{suspicions[0]}; or say units_checked=True")
    settings = settings.for_records(table["record"].nunique()) if default else settings
    prepare_jax(max(settings.chains, _DEVICES))
    if out is not None:
        return _with_warning(_fit_into(Path(out), table, settings, model, units_checked, progress))
    prepared = prepare_records(table, model)
    if text := without_effect(prepared.factors, model):
        warnings.warn(text, stacklevel=2)
    with Stages(progress) as stages:
        tree = fit_hierarchical(table, _with_bars(settings, stages), model, prepared)
        stages.begin("diagnostics")
        posterior = _judged(
            tree,
            lambda tree, attempt: identify_records(tree, prepared, model, attempt),
            used_points(table, model.region),
        )
    return _with_warning(posterior)


def _fit_into(
    out: Path, table: pd.DataFrame, settings: SamplerSettings, model: ModelSettings, units_checked: bool, progress: bool
) -> Posterior:
    """Return the posterior as the command `fit` would write it, read from the folder that it is written into."""
    check_folder(out)
    records = out / "records.csv"
    with sole_run(out), Stages(progress) as stages:
        write_table(table, records)
        watched = _with_bars(settings, stages)
        callbacks = Callbacks(watched.on_note, on_progress=watched.on_progress, on_stage=watched.on_stage)
        plan = Plan((records,), settings, model, units_checked=units_checked)
        fit_table(table, plan, out, ("fit", "called", "from", "Python"), callbacks)
    return read_posterior(out)


def _with_warning(posterior: Posterior) -> Posterior:
    """Return the posterior, and warn the caller of `fit` where the verdict is not `pass`: draws do not show it."""
    if posterior.attrs["verdict"] != "pass":
        warnings.warn("verdict fail: the numbers are not to be trusted; bt.diagnose(posterior) says why", stacklevel=3)
    return posterior


def fit_published(
    settings: SamplerSettings | None = None, priors: Mapping[str, object] | None = None, *, progress: bool = True
) -> Posterior:
    """Return the posterior of the source's printed means of k and beta (Tables 9 and 11) alone, with its verdict.

    Parameters
    ----------
    settings:
        How much to sample.
    priors, progress:
        As `fit` takes them.
    """
    settings = settings or SamplerSettings(longest=LONGEST)
    prepare_jax(max(settings.chains, _DEVICES))
    printed = tables.case_means()
    all_priors = PRIORS.changed(priors or {})
    with Stages(progress) as stages:
        tree = fit_printed_means(printed, _with_bars(settings, stages), all_priors)
        stages.begin("diagnostics")
        posterior = _judged(tree, lambda tree, attempt: identify_published(tree, printed, all_priors, attempt))
    return _with_warning(posterior)


def read_posterior(folder: str | Path) -> Posterior:
    """Return the posterior of records in a folder that `bayes-tyre fit` wrote, with its verdict.

    Raises
    ------
    BadInput
        If the folder holds no finished result of records.
    """
    result = read_result(Path(folder))
    result.tree.attrs["verdict"] = result.verdict
    return Posterior.of(result.tree)


def diagnose(posterior: xr.DataTree) -> Diagnostics:
    """Return whether a posterior may be trusted: the verdict, its reasons and the figures behind them."""
    return with_failures(diagnostics.diagnose(put_together(posterior)), checks_in(posterior, FAILED))


def with_log_likelihood(
    posterior: xr.DataTree,
    records: pd.DataFrame,
    model: ModelSettings | None = None,
    priors: Mapping[str, object] | None = None,
) -> Posterior:
    """Return the posterior with ArviZ's group `log_likelihood`, a record an observation: `az.loo` then works on it.

    It keeps about 500 of the draws, of the group `posterior` as well.

    Parameters
    ----------
    posterior:
        Of records.
    records:
        As they were given to `fit`, in any order.
    model, priors:
        Those of the posterior, which knows them: there is no need to give them.

    Raises
    ------
    BadInput
        For records, a model or priors that are not those of the posterior.
    """
    prepare_jax(_DEVICES)
    tree = put_together(posterior)
    if model is not None or priors is not None:
        fitted = model_of(tree)
        given = replace(model, priors=fitted.priors) if model is not None and priors is None else model or fitted
        log_likelihood.check_same_model(tree, _with_priors(given, priors))
    return Posterior.of(log_likelihood.with_log_likelihood(tree, check_record_table(records)))


def _with_priors(model: ModelSettings | None, priors: Mapping[str, object] | None) -> ModelSettings:
    if not isinstance(model, ModelSettings | None):
        raise BadInput(f"model is {model!r}; give options of the model: model=ModelSettings(law='small_step_limit')")
    model = model or ModelSettings()
    return replace(model, priors=model.priors.changed(priors or {}))


def _with_bars(settings: SamplerSettings, stages: Stages) -> SamplerSettings:
    """Return settings that move the bars too, beside what they call already."""

    def begin(name: str, total: int | None = None) -> None:
        settings.on_stage(name, total)
        stages.begin(name, total)

    def advance(done: int) -> None:
        settings.on_progress(done)
        stages.advance(done)

    return replace(settings, on_stage=begin, on_progress=advance)


def _judged(
    tree: xr.DataTree, identify: Callable[[xr.DataTree, Attempt], xr.DataTree], table: pd.DataFrame | None = None
) -> Posterior:
    """Return the posterior carrying its verdict, the figures behind it, and what of it came from the records."""
    attempts = Attempts()
    judged, diagnostics = judge(tree, identify, attempts, table)
    judged = attempts("derived quantities", lambda: with_derived(judged), judged)
    judged = with_checks(judged, FAILED, attempts.failed)
    judged.attrs["verdict"] = with_failures(diagnostics, attempts.failed).verdict
    return Posterior.of(judged)


def _verdict(posterior: xr.DataTree) -> str:
    return posterior.attrs.get("verdict") or diagnose(posterior).verdict


def _checked(interval: float) -> float:
    if not 0.0 < interval < 1.0:
        raise BadInput(f"interval is {interval}: it is a probability; give a number between 0 and 1, such as 0.95")
    return interval


def cases(posterior: xr.DataTree, interval: float = 0.95) -> pd.DataFrame:
    """Return k (kN/mm) and beta (mm) of each case: the columns of `cases.csv`.

    `interval`, here and below, is the probability between `lower` and `upper`, equal-tailed; where it is none between
    0 and 1 it is refused as `BadInput`.
    """
    return summary.cases(put_together(posterior), _verdict(posterior), _checked(interval))


def contrasts(posterior: xr.DataTree, interval: float = 0.95) -> pd.DataFrame:
    """Return ratios of k and of beta between configurations and directions: the columns of `contrasts.csv`.

    Of a fit with ``--reference`` that configuration is below in each of its ratios, as it is in the file.
    """
    return _result(posterior, interval).contrasts


def repeats(posterior: xr.DataTree, interval: float = 0.95) -> pd.DataFrame:
    """Return the parameters of each record and whether it is discordant: the columns of `repeats.csv`."""
    return summary.repeats(put_together(posterior), _verdict(posterior), _checked(interval))


def figure(
    posterior: xr.DataTree, name: str, records: pd.DataFrame | None = None, interval: float = 0.95
) -> NotebookFigure:
    """Return a figure of a posterior, as `fit` writes it into `figures/`; a notebook shows it by itself.

    Parameters
    ----------
    posterior:
        Of records, or of the printed tables.
    name:
        Of the file, such as ``contrasts`` or ``posteriors_by_direction``.
    records:
        The table that was fitted, its records in any order; figures of records need it.
    interval:
        Probability of every interval, equal-tailed.

    Returns
    -------
    NotebookFigure
        `figure`, to change it in matplotlib, and `save`.

    Raises
    ------
    BadInput
        For a name that there is not, a figure of records without records, records that were not fitted, and an interval
        that is no probability.
    """
    tree, table = put_together(posterior), None
    if records is not None and "record" in tree["posterior"].dims:
        table = used_points(fitted_records(tree, check_record_table(records)), model_of(tree).region)
    from_tables = posterior.attrs["origin"] in ("published", "reconstructed")
    printed = tables.case_means() if from_tables else None
    return NotebookFigure(chosen_figure(replace(_result(posterior, interval), table=table, printed=printed), name))


def _result(posterior: xr.DataTree, interval: float) -> Result:
    tree = put_together(posterior)
    return Result(tree, _verdict(posterior), interval=_checked(interval), reference=tree.attrs.get(ratios.REFERENCE))


def predict(
    posterior: xr.DataTree,
    case: str | Sequence[str],
    displacement_mm: Sequence[float | int] | np.ndarray | None = None,
    *,
    of: str = "case",
    interval: float = 0.95,
    seed: int = 0,
) -> Prediction:
    """Return force (kN) against displacement (mm) of a case, loading and unloading, and its mean parameters.

    Parameters
    ----------
    posterior:
        Of records.
    case:
        A label such as ``single (0)30-20``, or factors such as ``configuration=single,speed_km_h=0``; or several.
        Speeds, loads and steps need not have been tested.
    displacement_mm:
        From the start of the step; by default as far as the case's records go.
    of:
        ``case``, its mean curve, or ``repeat``, one more measurement of it.
    interval:
        Probability between `lower` and `upper`.
    seed:
        Of what a repeat adds, and of cases that were not tested.

    Returns
    -------
    Prediction
        `curves`, the columns of `prediction.csv`; `parameters`, a mapping a case; `warnings`.

    Raises
    ------
    BadInput
        For a posterior without records, a case that it does not hold, and an interval that is no probability.
    """
    interval = _checked(interval)
    verdict, tree = _verdict(posterior), put_together(posterior)
    query = parse_query([case] if isinstance(case, str) else case, prediction.predictable_cases(tree))
    grid = None if displacement_mm is None else np.asarray(displacement_mm, dtype=float).ravel()
    alone = [Weighted(tree, 1.0)]
    return prediction.predict_stack(alone, query, grid, verdict=verdict, of=of, interval=interval, seed=seed)


def equation_2(
    d: ArrayLike, *, k: ArrayLike, C: ArrayLike, beta: ArrayLike, d_i: ArrayLike, F_i: ArrayLike
) -> Float[Array, "..."]:
    """Return the force (kN) at displacement d (mm) by Equation 2, in float64; all arguments broadcast together.

    k in kN/mm, C and F_i in kN, beta and d_i in mm. Inside a function that JAX compiles, take
    `bayes_tyre.laws.fancher.equation_2` instead.

    Examples
    --------
    >>> import bayes_tyre as bt
    >>> float(bt.equation_2(3.0, k=1.8, C=0.4, beta=0.05, d_i=0.0, F_i=0.0).round(3))
    5.8
    """
    prepare_jax(_DEVICES)
    return fancher.equation_2(d, k=k, C=C, beta=beta, d_i=d_i, F_i=F_i)
