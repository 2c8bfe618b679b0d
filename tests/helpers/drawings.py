"""Hand-made tables, what each figure draws of them, and what can be read off a figure."""

from functools import lru_cache, partial
from itertools import product
from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from bayes_tyre.report.figures import contrast as contrast_figures
from bayes_tyre.report.figures import densities as density_figures
from bayes_tyre.report.figures import forest as case_figures
from bayes_tyre.report.figures import record as record_figures
from bayes_tyre.report.figures import sampler as sampler_figures
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import STYLE
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter
from bayes_tyre.results.figure_data.prior_curves import PriorPanel
from bayes_tyre.results.figure_data.prior_posterior import PriorPosterior
from bayes_tyre.results.figure_data.ranks import Ranks

FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
MEASURED = Setting("measured")
#: Figures whose configurations differ in colour, marker or line, and those that show none.
OF_CONFIGURATIONS = (
    *("posteriors_by_direction", "forest_of_cases", "records_with_bands", "outlier_probabilities"),
    *("residuals_against_displacement", "prior_predictive_curves", "pair_plot"),
)
ALL = (*OF_CONFIGURATIONS, "contrasts", "rank_plot", "prior_and_posterior_of_scales")


def factors_of_cases(configurations=("single", "dual"), speeds=(0.0, 25.0)) -> pd.DataFrame:
    steps = (("loading", 10.0, 5.0), ("loading", 20.0, 10.0), ("unloading", 30.0, -10.0))
    rows = [(c, d, v, load, step) for c in configurations for v in speeds for d, load, step in steps]
    return pd.DataFrame(rows, columns=FACTORS)


def printed_values(**factor_table) -> pd.DataFrame:
    table = factors_of_cases(**factor_table)
    return table.assign(k_kN_per_mm=np.linspace(1.4, 2.6, len(table)), beta_mm=np.geomspace(0.005, 0.1, len(table)))


def cases(**factor_table) -> pd.DataFrame:
    printed = printed_values(**factor_table)
    blocks = [
        printed[FACTORS].assign(parameter=parameter, unit=unit, median=printed[column] * 1.01)
        for parameter, unit, column in (("k", "kN/mm", "k_kN_per_mm"), ("beta", "mm", "beta_mm"))
    ]
    table = pd.concat(blocks, ignore_index=True)
    return table.assign(lower=table["median"] * 0.9, upper=table["median"] * 1.1, interval=0.95)


def contrasts(configurations=("single", "dual")) -> pd.DataFrame:
    """Return ratios of the first two configurations, and of the directions of each."""
    both, blank = " / ".join(configurations[:2]), dict.fromkeys(FACTORS, np.nan)
    of_cases = factors_of_cases(configurations[:1]).assign(configuration=np.nan, contrast=both, matching="same case")
    average = pd.DataFrame([{**blank, "contrast": both, "matching": "same case"}])
    factor_table = {"contrast": "loading / unloading", "matching": "same span"}
    directions = pd.DataFrame([{**blank, **factor_table, "configuration": name} for name in configurations])
    table = pd.concat([average, of_cases, directions], ignore_index=True)
    ratios = np.linspace(0.9, 1.4, len(table))
    blocks = [table.assign(parameter=name, median=ratios**power) for name, power in (("k", 1.0), ("beta", 4.0))]
    both_parameters = pd.concat(blocks, ignore_index=True)
    spread = {"lower": both_parameters["median"] * 0.9, "upper": both_parameters["median"] * 1.1, "interval": 0.95}
    return both_parameters.assign(**spread, p_greater_than_1=np.clip(both_parameters["median"] - 0.5, 0, 1))


def cells(configurations=("single", "dual"), spread=0.05, draws=200) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    blocks = []
    scales = (("k", "kN/mm", 1.8), ("beta", "mm", 0.03))
    for name, direction, (parameter, unit, middle) in product(configurations, ("loading", "unloading"), scales):
        factor_table = {"configuration": name, "direction": direction, "parameter": parameter, "unit": unit}
        blocks.append(pd.DataFrame({**factor_table, "value": middle * np.exp(spread * rng.normal(size=draws))}))
    return pd.concat(blocks, ignore_index=True)


def repeats(**factor_table) -> pd.DataFrame:
    table = factors_of_cases(**factor_table).loc[lambda t: t.index.repeat(3)].reset_index(drop=True)
    probability = np.linspace(0.001, 0.2, len(table))
    probability[4] = 0.97
    names = [f"record {i}" for i in range(len(table))]
    return table.assign(record=names, repeat=np.arange(len(table)) % 3 + 1, outlier_probability=probability)


def records(names=("first", "second"), points=60) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return measured points and their bands; each record's configuration is called as the record."""
    u = 4 * (1 - np.cos(np.linspace(0, np.pi, points))) / 2
    force = 20 + (0.4 + 1.8 * u) * -np.expm1(-u / 0.03)
    noise = 0.03 * np.random.default_rng(1).normal(size=points)
    measured = pd.DataFrame({"displacement_mm": 12 + u, "force_kN": force + noise})
    band = measured[["displacement_mm"]].assign(median_kN=force, lower_kN=force - 0.06, upper_kN=force + 0.06)
    tables = (
        pd.concat([one.assign(record=name, configuration=name) for name in names], ignore_index=True)
        for one in (measured, band)
    )
    return next(tables), next(tables)


def residuals(names=("first", "second"), points=60) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return residuals, and a row a record: sigma, autocorrelation, a configuration called as the record."""
    measured, band = records(names, points)
    left = measured[["record", "displacement_mm"]].assign(residual_kN=measured["force_kN"] - band["median_kN"])
    figures = {"sigma_kN": 0.03, "autocorrelation": np.linspace(-0.2, 0.4, len(names))}
    return left, pd.DataFrame({"record": names, "configuration": names, **figures})


def panels(configurations=("single", "dual"), curves=3) -> list[PriorPanel]:
    measured = records(("like",))[0][["record", "displacement_mm", "force_kN"]]
    d = measured["displacement_mm"]
    band = pd.DataFrame({"displacement_mm": d, "lower_kN": 5.0, "upper_kN": 60.0})
    prior = [pd.DataFrame({"record": i, "displacement_mm": d, "force_kN": 10.0 + i * (d - 12)}) for i in range(curves)]
    return [PriorPanel("like", name, "loading", pd.concat(prior), band, measured) for name in configurations]


def hyperparameters(configurations=("single", "dual"), chains=4, draws=200) -> list[Hyperparameter]:
    rng = np.random.default_rng(7)
    shape = (chains, draws)
    of_groups = [Hyperparameter(f"k_group[{c} loading]", "kN/mm", c, rng.normal(2, 0.1, shape)) for c in configurations]
    return [*of_groups, Hyperparameter("sd_log_k_case", "", None, np.exp(rng.normal(-3, 0.2, shape)))]


def ranks(count=6, chains=4) -> list[Ranks]:
    at = np.linspace(0, 1, 51)
    excess = 0.02 * np.sin(np.arange(1, chains + 1)[:, None] * np.pi * at)
    return [Ranks(f"k_group[{i}]", at, excess, 0.05 * np.sqrt(at * (1 - at))) for i in range(count)]


def prior_posteriors(contractions=(0.9, 0.1, 0.5, 0.0, 1.0)) -> list[PriorPosterior]:
    at = np.linspace(0.01, 1.0, 100)
    prior, posterior = np.exp(-(at**2)), np.exp(-(((at - 0.2) / 0.05) ** 2))
    return [PriorPosterior(f"scale_{i}", "kN", i % 2 == 0, at, prior, posterior, c) for i, c in enumerate(contractions)]


_FIGURES = {
    "posteriors_by_direction": density_figures.posteriors_by_direction,
    "forest_of_cases": case_figures.forest_of_cases,
    "contrasts": contrast_figures.contrasts_by_case,
    "outlier_probabilities": case_figures.outlier_probabilities,
    "records_with_bands": record_figures.records_with_bands,
    "residuals_against_displacement": partial(record_figures.residuals_against_displacement, threshold=0.3),
    "prior_predictive_curves": record_figures.prior_predictive_curves,
    "pair_plot": sampler_figures.pair_plot,
    "rank_plot": sampler_figures.rank_plot,
    "prior_and_posterior_of_scales": density_figures.prior_and_posterior_of_scales,
}


def made(name: str, configurations: tuple[str, ...]) -> list[Any]:
    """Return the hand-made tables that a figure is drawn from."""
    factor_table = {"configurations": configurations}
    return {
        "posteriors_by_direction": lambda: [cells(configurations)],
        "forest_of_cases": lambda: [cases(**factor_table), printed_values(**factor_table)],
        "contrasts": lambda: [contrasts(**factor_table)],
        "outlier_probabilities": lambda: [repeats(**factor_table)],
        "records_with_bands": lambda: [*records(configurations)],
        "residuals_against_displacement": lambda: [*residuals(configurations)],
        "prior_predictive_curves": lambda: [panels(configurations)],
        "pair_plot": lambda: [hyperparameters(configurations), np.zeros((4, 200), dtype=bool)],
        "rank_plot": lambda: [ranks()],
        "prior_and_posterior_of_scales": lambda: [prior_posteriors()],
    }[name]()


@lru_cache(maxsize=100)
def drawn(name: str, setting: Setting = MEASURED, configurations: tuple[str, ...] = ("single", "dual")) -> Figure:
    """Return a figure of hand-made tables; `drawn.__wrapped__` draws it anew."""
    return _FIGURES[name](*made(name, configurations), setting)


def said(figure: Figure) -> list[str]:
    """Return every text of a figure."""
    return [text.get_text() for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]


def markers(ax: Axes, *wanted: str) -> np.ndarray:
    """Return x and y of everything drawn with the markers, shape (drawn, 2)."""
    return np.concatenate([np.asarray(line.get_xydata()) for line in ax.lines if line.get_marker() in wanted])


def segments(ax: Axes) -> list[np.ndarray]:
    """Return the ends of every horizontal line that a list of cases holds."""
    collections = [c for c in ax.collections if isinstance(c, LineCollection) and c.get_transform() == ax.transData]
    return [segment for collection in collections for segment in collection.get_segments()]


def sticking_out(figure: Figure) -> list[str]:
    """Return notes, titles, labels and legend texts that do not lie within the page, one pixel to spare."""
    with matplotlib.style.context(STYLE):  # as it is written: ticks are made as they are drawn
        figure.draw_without_rendering()  # a legend's texts have no place before
    shown = [ax for ax in figure.get_axes() if ax.get_visible()]
    texts = [text for ax in shown for text in (ax.title, ax.xaxis.label, ax.yaxis.label)]
    texts += [*figure.texts, *(text for box in figure.legends for text in box.get_texts())]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    page = figure.bbox.padded(1)
    return [text for text, box in boxes if not (page.contains(box.x0, box.y0) and page.contains(box.x1, box.y1))]
