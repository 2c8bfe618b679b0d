"""The source's rule beside the posterior: what it leaves out, what the means are then, and what is drawn."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import markers, said, sticking_out
from scipy.stats import t
from support.rule import PLAIN, POSTERIOR, RULE, by_multiple, k_by_method
from support.rule_figures import rule_and_posterior

from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page.colours import Setting

#: k of three repeats: one far off by 30 % of the others' mean, or 7.5 times the usual scatter; none.
K = {"single": (1.0, 1.0, 1.3), "dual": (2.0, 2.02, 2.04)}


@pytest.fixture
def fits() -> pd.DataFrame:
    rows = [
        (f"{name} {i + 1}", name, "loading", 0.0, 20.0, 10.0, i + 1, k)
        for name, repeats in K.items()
        for i, k in enumerate(repeats)
    ]
    return pd.DataFrame(rows, columns=["record", *CASE_FACTORS, "repeat", "k_kN_per_mm"])


@pytest.fixture
def cases(fits) -> pd.DataFrame:
    of = fits.drop_duplicates("configuration")[list(CASE_FACTORS)]
    k = of.assign(parameter="k", median=[1.02, 2.02], lower=[0.95, 1.9], upper=[1.1, 2.15], interval=0.95)
    return pd.concat([k, k.assign(parameter="beta", median=0.03)], ignore_index=True)


def test_the_number_left_out_hangs_on_the_multiple(fits):
    discordant = fits.set_index("record").index.to_series().eq("single 3")
    table = by_multiple(fits, discordant, (0.2, 6, 8))
    assert table.to_numpy().tolist() == [[0.2, 2, 1, 1, 0], [6, 1, 1, 0, 0], [8, 0, 0, 0, 1]]


def test_means_are_of_the_repeats_kept_with_students_interval(fits, cases):
    rows = k_by_method(fits, cases, multiple=6).to_dict("records")
    of = {(row["configuration"], row["method"]): row for row in rows}
    assert of["single", PLAIN]["k_kN_per_mm"] == pytest.approx(1.1)
    half = t.ppf(0.975, 2) * np.std(K["single"], ddof=1) / np.sqrt(3)
    assert of["single", PLAIN]["upper"] == pytest.approx(1.1 + half)
    kept = of["single", RULE]
    assert (kept["k_kN_per_mm"], kept["lower"], kept["upper"], kept["left_out"]) == (1.0, 1.0, 1.0, "single 3")
    assert of["dual", RULE]["k_kN_per_mm"] == of["dual", PLAIN]["k_kN_per_mm"]
    told = of["dual", POSTERIOR]
    assert (told["k_kN_per_mm"], told["lower"], told["upper"]) == (2.02, 1.9, 2.15)


def test_the_figure_shows_repeats_what_is_left_out_and_the_posterior_in_its_colours(fits, cases):
    table = k_by_method(fits, cases, multiple=6)
    figure = rule_and_posterior(fits, table, Setting("reconstructed", "pass", tuple(K)))
    (ax,) = figure.get_axes()
    assert "data: reconstructed, not measured" in said(figure)
    assert not sticking_out(figure)
    np.testing.assert_allclose(np.sort(markers(ax, "|")[:, 0]), np.sort(fits["k_kN_per_mm"]))
    assert markers(ax, "x")[:, 0].tolist() == [1.3]
    medians = cases[cases["parameter"] == "k"].set_index("configuration")["median"].to_dict()
    for name, look in Setting("measured").looks(K).items():
        assert medians[name] in markers(ax, look.marker)[:, 0]
