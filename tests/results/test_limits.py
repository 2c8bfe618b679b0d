"""Limits: what is one, and the share of draws that keep it."""

import numpy as np
import pytest
from helpers.command_line import small
from helpers.hand_made_posteriors import posterior, scattered
from hypothesis import given
from hypothesis import strategies as st

from bayes_tyre.errors import BadInput
from bayes_tyre.record_table import record_factors
from bayes_tyre.results.limits import LIMITED, OF_RECORDS, Limit, parse_limit, with_limit
from bayes_tyre.results.summary import cases


@given(st.sampled_from(LIMITED), st.sampled_from([">=", "<="]), st.floats(allow_nan=False, allow_infinity=False))
def test_a_limit_comes_back_from_its_text(parameter, sign, value):
    limit = Limit(parameter, sign, value)
    assert parse_limit(limit.text) == parse_limit(f"  {parameter}{sign}{value!r} ") == limit


@pytest.mark.parametrize(
    "text", ["", "k", "k > 1", "k >= ", "k >= stiff", "k >= nan", "k >= inf", "1 >= k", "k >= 1 2"]
)
def test_what_is_no_limit_is_told_what_one_is(text):
    with pytest.raises(BadInput, match=r"is no limit; give PARAMETER >= NUMBER or <= NUMBER, such as 'k >= 1.8'"):
        parse_limit(text)


def test_what_no_case_has_is_told_what_they_have():
    with pytest.raises(BadInput, match="'sigma' is no parameter of a case here; give a limit on k, x, "):
        parse_limit("sigma >= 1")
    with pytest.raises(BadInput, match=r"'x' is no parameter of a case here; give a limit on k, beta$"):
        parse_limit("x >= 1", OF_RECORDS)


def test_the_probability_is_the_share_of_draws_and_never_0_or_1():
    factor_table = record_factors(small())
    tree = posterior(scattered(factor_table, seed=4), factor_table)
    table = cases(tree, "pass")
    draws = tree["posterior"]["beta_case"].transpose("case", "chain", "draw").to_numpy().reshape(len(table) // 2, -1)
    middle = float(np.median(draws))
    for text, keeps in ((f"beta >= {middle}", draws >= middle), (f"beta <= {middle}", draws <= middle)):
        limited = with_limit(table, tree, parse_limit(text))
        mine = limited["parameter"] == "beta"
        expected = [(sum(row) + 0.5) / (len(row) + 1) for row in keeps.tolist()]
        np.testing.assert_allclose(limited.loc[mine, "p_limit"], expected, rtol=1e-12)
        assert limited.loc[~mine, "p_limit"].isna().all()
        assert set(limited.loc[mine, "limit"]) == {parse_limit(text).text}
        assert list(limited.columns[-4:]) == ["limit", "p_limit", "origin", "verdict"]
    assert "p_limit" not in table
    certain = with_limit(table, tree, Limit("beta", ">=", -1.0))["p_limit"].dropna()
    assert (certain == (draws.shape[1] + 0.5) / (draws.shape[1] + 1)).all()
    with pytest.raises(BadInput, match="no case here has m; give one on k, beta"):
        with_limit(table, tree, Limit("m", ">=", 1.0))
