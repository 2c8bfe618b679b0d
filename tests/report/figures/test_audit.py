"""Figures of the audit draw what they are given, and say that it was simulated."""

import numpy as np
import pytest
from helpers.audit_made_up import SMALL, audited, blind
from helpers.drawings import markers, said, sticking_out

from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.studies.audit.grid import FACTOR_NAMES, TYPICAL_LEVELS
from bayes_tyre.studies.audit.overview import beta_by_window, bias_by_factor, overview


def draw(rule):
    table = audited(rule).table
    tables = (table, bias_by_factor(table, "k"), overview(table), beta_by_window(table, "thesis"))
    return audit_figures.draw(*tables, FACTOR_NAMES, TYPICAL_LEVELS)


@pytest.fixture(scope="module")
def drawn():
    return dict(draw(blind))


def test_every_figure_names_its_origin_and_keeps_within_the_page(drawn):
    assert set(drawn) == {"beta_returned", "k_bias", "coverage", "beta_window"}
    for figure in drawn.values():
        assert "data: simulated, not measured" in said(figure)
        assert sticking_out(figure) == []


def test_beta_is_drawn_against_the_truth_with_the_identity(drawn):
    thesis, *_, motion = drawn["beta_returned"].get_axes()
    assert (thesis.get_xscale(), thesis.get_yscale()) == ("log", "log")
    d, beta = markers(motion, "o", "s", "^", "v").T
    np.testing.assert_allclose(beta, 1.02 * d)
    assert len(d) == len(SMALL.tyres())
    identity = [line for line in motion.lines if line.get_linestyle() == "--"]
    assert len(identity) == 1
    np.testing.assert_array_equal(*np.asarray(identity[0].get_xydata()).T)


def test_bias_of_k_has_a_panel_a_factor(drawn):
    panels = [ax for ax in drawn["k_bias"].get_axes() if ax.get_visible()]
    assert len(panels) == len(FACTOR_NAMES)
    # Every method's k is 2 % too high at every level, beside the line at 0.
    at = [np.unique(np.round(np.concatenate([line.get_ydata() for line in ax.lines]), 9)) for ax in panels]
    assert all(heights.tolist() == [0.0, 2.0] for heights in at)


def test_beta_by_window_has_a_panel_a_true_beta(drawn):
    panels = drawn["beta_window"].get_axes()
    assert [ax.get_title() for ax in panels] == ["true beta 0.04 mm", "true beta 0.12 mm"]
    first = next(line for line in panels[0].lines if line.get_marker() not in ("None", None))
    np.testing.assert_allclose(np.asarray(first.get_xydata()), [[1, 0.06], [801, 0.02]])


def test_an_audit_without_a_value_is_drawn_too():
    for _, figure in draw(lambda *_: None):
        assert "data: simulated, not measured" in said(figure)
