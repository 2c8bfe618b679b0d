"""Which figures a result has: each name with its drawing, which holds its tables and needs no posterior."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.diagnostics.residual_checks import AUTOCORRELATION_MOST
from bayes_tyre.inference.diagnostics.residuals import residuals
from bayes_tyre.inference.sampling.datatree import is_of_motions, priors_of, tree_cases
from bayes_tyre.inference.sampling.group_means import group_means
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.report.figures.contrast import contrasts_by_case
from bayes_tyre.report.figures.densities import posteriors_by_direction, prior_and_posterior_of_scales
from bayes_tyre.report.figures.forest import forest_of_cases, outlier_probabilities
from bayes_tyre.report.figures.motion import loops_by_direction, motion_figure
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.record import prior_predictive_curves, records_with_bands, residuals_against_displacement
from bayes_tyre.report.figures.sampler import pair_plot, rank_plot
from bayes_tyre.results import summary
from bayes_tyre.results.contrasts import contrasts, with_reference
from bayes_tyre.results.figure_data import posterior_predictive
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter, divergences, hyperparameters, paired
from bayes_tyre.results.figure_data.hysteresis_loops import LAW, friction_loops
from bayes_tyre.results.figure_data.prior_curves import prior_panels
from bayes_tyre.results.figure_data.prior_posterior import prior_posteriors
from bayes_tyre.results.figure_data.ranks import ranks
from bayes_tyre.results.limits import Limit, with_limit

ENERGY, CONTRASTS = "energy_per_cycle", "contrasts"
OUTLIERS, LOOPS = "outlier_probabilities", "loops_by_direction"
#: Before the place of a record's figure among those shown.
MOTION = "motion_"
#: What the intervals of cases and contrasts are of, where a reader could take them for something else, by model.
ABOUT_CASES = {"published": "They are of the expected value; individual printed values scatter about it."}
ABOUT_CONTRASTS = {"published": "One value a case was printed: the model has one ratio for all cases of a direction."}


#: Draws one figure from the tables that it holds; it can be sent to another process.
type Drawing = Callable[[], Figure]


@dataclass(frozen=True)
class Result:
    """What the figures of a fit are drawn from.

    Attributes
    ----------
    tree, verdict:
        The posterior, and ``pass`` or ``fail``.
    table:
        The records it was fitted to; None without records.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case; None where there are none to be held against.
    interval:
        Probability of every interval, equal-tailed.
    motions:
        Readings and fitted motion of a few records, from `results.figure_data.motion_traces`; None without.
    limit:
        What `cases` says the probability of; None without.
    reference:
        The configuration below in each of its ratios; None: the later in sorted order.
    """

    tree: xr.DataTree
    verdict: str
    table: pd.DataFrame | None = None
    printed: pd.DataFrame | None = None
    interval: float = 0.95
    motions: pd.DataFrame | None = None
    limit: Limit | None = None
    reference: str | None = None

    @cached_property
    def cases(self) -> pd.DataFrame:
        """As `cases.csv` holds them."""
        cases = summary.cases(self.tree, self.verdict, self.interval)
        return cases if self.limit is None else with_limit(cases, self.tree, self.limit)

    @cached_property
    def contrasts(self) -> pd.DataFrame:
        """As `contrasts.csv` holds them."""
        table = contrasts(self.tree, self.verdict, self.interval)
        return table if self.reference is None else with_reference(table, self.reference, self.setting.configurations)

    @cached_property
    def judged(self) -> pd.DataFrame:
        """The factors of each record, and the probability that it is discordant."""
        return summary.judged_records(self.tree)

    @property
    def of_motions(self) -> bool:
        """Whether it is a posterior of motions."""
        return is_of_motions(self.tree["posterior"].to_dataset())

    @property
    def judges(self) -> bool:
        """Whether its model says of any record how probable it is that it is discordant."""
        return bool(self.judged["outlier_probability"].notna().any())

    @cached_property
    def setting(self) -> Setting:
        """What its figures share."""
        configurations = {case.configuration or "" for case in tree_cases(self.tree["posterior"].to_dataset())}
        return Setting(self.tree.attrs["origin"], self.verdict, tuple(sorted(configurations)))

    @cached_property
    def hyperparameters(self) -> list[Hyperparameter]:
        """The parameters of its populations."""
        return hyperparameters(self.tree)

    @cached_property
    def shown(self) -> list[str]:
        """The names of a few of its records."""
        return posterior_predictive.records_to_show(self.tree)


def draw(result: Result, attempt: Attempt = directly) -> Iterator[tuple[str, Figure]]:
    """Yield the name and the figure of everything that can be drawn of a result, one after the other.

    Parameters
    ----------
    result:
        What is drawn.
    attempt:
        Draws each figure, by the name of its file; one that fails is passed over.
    """
    for name, drawing in drawings(result, attempt):
        if (figure := attempt(f"{name}.png", drawing, None)) is not None:
            yield name, figure


def drawings(result: Result, attempt: Attempt = directly) -> Iterator[tuple[str, Drawing]]:
    """Yield the name and the drawing of everything that can be drawn of a result; arguments as `draw` has them."""
    for name, prepare in _prepared(result):
        if (drawing := attempt(f"{name}.png", prepare, None)) is not None:
            yield name, drawing


def _prepared(result: Result) -> Iterator[tuple[str, Callable[[], Drawing | None]]]:
    """Yield the name of each figure with what computes its drawing: None where the result has nothing to show by it."""
    for name, figure in {**ALWAYS, **(OF_MOTIONS if result.of_motions else {})}.items():
        yield name, partial(_contrasts_if_any if name == CONTRASTS else figure, result)
    yield LOOPS, lambda: _loops(result)
    if result.table is not None:
        for name, figure_of_records in OF_RECORDS.items():
            yield name, partial(figure_of_records, result, result.table)
    yield OUTLIERS, lambda: OF_REPEATS[OUTLIERS](result) if result.judges else None
    if result.motions is not None:
        for place, readings in result.motions.groupby("shown", sort=False):
            yield f"{MOTION}{place}", lambda readings=readings: partial(motion_figure, readings, result.setting)


def _contrasts_if_any(result: Result) -> Drawing | None:
    """Return the drawing of ratios; None without cases that match: its panels would be empty."""
    return ALWAYS[CONTRASTS](result) if len(result.contrasts) else None


def _posteriors(result: Result) -> Drawing:
    draws = _group_draws(result.tree)
    return partial(posteriors_by_direction, draws[draws["parameter"] != ENERGY], result.setting, result.interval)


def _energy(result: Result) -> Drawing:
    draws = _group_draws(result.tree)
    return partial(
        posteriors_by_direction,
        draws[draws["parameter"] == ENERGY],
        result.setting,
        result.interval,
        _about_energy(result),
    )


def _loops(result: Result) -> Drawing | None:
    """Return the drawing of the loop of a cycle, where the posterior is of motions on the law whose loop is known."""
    attributes = result.tree.attrs
    if not (result.of_motions and "amplitude_mm" in attributes and attributes.get("law", LAW) == LAW):
        return None
    amplitude = float(attributes["amplitude_mm"])
    loops = friction_loops(result.tree, result.interval)
    return partial(loops_by_direction, loops, result.setting, amplitude, result.interval)


def _about_energy(result: Result) -> str:
    amplitude = result.tree.attrs.get("amplitude_mm")
    return "" if amplitude is None else f"Energy: of a cycle of {amplitude:g} mm amplitude at the wheel centre."


def _group_draws(tree: xr.DataTree) -> pd.DataFrame:
    """Return the draws of the group means in long form: configuration, direction, parameter, unit, value."""
    means = group_means(tree)
    long = means.stack(sample=("chain", "draw", "group")).reset_index("sample", drop=True)
    factors = {factor: long[factor].to_numpy() for factor in ("configuration", "direction")}
    blocks = [
        pd.DataFrame({**factors, "parameter": name, "unit": RECORD_UNITS[str(name)], "value": draws.to_numpy()})
        for name, draws in long.data_vars.items()
    ]
    return pd.concat(blocks, ignore_index=True)


def _forest(result: Result) -> Drawing:
    about = ABOUT_CASES.get(result.tree.attrs["model"], "") or _about_energy(result)
    return partial(forest_of_cases, result.cases, result.printed, result.setting, about)


def _contrasts(result: Result) -> Drawing:
    about = ABOUT_CONTRASTS.get(result.tree.attrs["model"], "")
    return partial(contrasts_by_case, result.contrasts, result.setting, about)


def _prior_posteriors(result: Result) -> Drawing:
    of_all = prior_posteriors(result.hyperparameters, priors_of(result.tree))
    return partial(prior_and_posterior_of_scales, of_all, result.setting)


def _ranks(result: Result) -> Drawing:
    return partial(rank_plot, [ranks(one) for one in result.hyperparameters if one.varies], result.setting)


def _pairs(result: Result) -> Drawing:
    return partial(pair_plot, paired(result.hyperparameters), divergences(result.tree), result.setting)


def _priors(result: Result, table: pd.DataFrame) -> Drawing:
    panels = prior_panels(result.tree, table, result.interval)
    return partial(prior_predictive_curves, panels, result.setting, result.interval)


def _bands(result: Result, table: pd.DataFrame) -> Drawing:
    bands = posterior_predictive.predictive_bands(result.tree, table, result.shown, result.interval)
    return partial(
        records_with_bands, table[table["record"].isin(result.shown)], bands, result.setting, result.interval
    )


def _residuals(result: Result, table: pd.DataFrame) -> Drawing:
    off = residuals(result.tree, table)
    points, records = posterior_predictive.residual_tables(off, table, result.shown)
    return partial(residuals_against_displacement, points, records, result.setting, AUTOCORRELATION_MOST)


def _outliers(result: Result) -> Drawing:
    return partial(outlier_probabilities, result.judged, result.setting)


#: What computes the drawings of any posterior, by the name of their file; those of motions; of force over displacement;
#: and of repeats where the model judges them.
ALWAYS: Mapping[str, Callable[[Result], Drawing]] = {
    "posteriors_by_direction": _posteriors,
    "forest_of_cases": _forest,
    CONTRASTS: _contrasts,
    "prior_and_posterior_of_scales": _prior_posteriors,
    "rank_plot": _ranks,
    "pair_plot": _pairs,
}
OF_MOTIONS: Mapping[str, Callable[[Result], Drawing]] = {"energy_per_cycle": _energy}
OF_RECORDS: Mapping[str, Callable[[Result, pd.DataFrame], Drawing]] = {
    "prior_predictive_curves": _priors,
    "records_with_bands": _bands,
    "residuals_against_displacement": _residuals,
}
OF_REPEATS: Mapping[str, Callable[[Result], Drawing]] = {OUTLIERS: _outliers}


def chosen_figure(result: Result, name: str) -> Figure:
    """Return a figure that `bayes_tyre.report.figures.catalogue` knows, by the name of its file without suffix.

    Raises
    ------
    BadInput
        For a name that there is not, a figure of records without records, and one of discordant repeats where none is
        judged.
    """
    of_records = "record" in result.tree["posterior"].dims
    of_tree = {**ALWAYS, **OF_MOTIONS} if result.of_motions else ALWAYS
    names = [*of_tree, *([] if result.of_motions else OF_RECORDS), *OF_REPEATS]
    if name not in names:
        raise BadInput(f"figure {name!r} is unknown; use one of {', '.join(names)}")
    if name in of_tree:
        return of_tree[name](result)()
    if name in OF_REPEATS and result.judges:
        return OF_REPEATS[name](result)()
    if name in OF_RECORDS and result.table is not None and of_records:
        return OF_RECORDS[name](result, result.table)()
    if name in OF_REPEATS and of_records:
        raise BadInput(f"figure {name}: this posterior judges no record; that takes repeats mixture, three of a case")
    raise BadInput(f"figure {name} shows records; give the posterior of records, and their table")
