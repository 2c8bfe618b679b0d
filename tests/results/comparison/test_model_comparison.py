"""Models side by side: the table, its verdict, and what it says in a sentence."""

import numpy as np
import pytest
from helpers.left_out import made_up

from bayes_tyre.results.comparison.model_comparison import by_record, compare, sentence

RECORDS = [f"r{i}" for i in range(120)]
PASS = {"one": "pass", "two": "pass", "three": "pass"}


def elpd(seed: int, lower: float = 0.0) -> np.ndarray:
    return np.random.default_rng(seed).normal(50.0 - lower, 1.0, len(RECORDS))


@pytest.fixture
def found():
    """Return three models: one hardly better than the other, and one far worse in every record."""
    best = elpd(1)
    nearly = best + np.random.default_rng(2).normal(-0.01, 0.5, len(RECORDS))
    return {"two": made_up(nearly, RECORDS), "three": made_up(best - 1.0, RECORDS), "one": made_up(best, RECORDS)}


def test_the_best_comes_first_and_differences_are_sums_over_records(found):
    table = compare(found, PASS)
    assert table["rank"].tolist() == [1, 2, 3]
    assert table["model"].iloc[-1] == "three"
    sums = {name: float(each.elpd.elpd_i.sum()) for name, each in found.items()}
    best = max(sums.values())
    for row in table.itertuples():
        assert row.elpd == pytest.approx(sums[str(row.model)])
        assert row.elpd_difference == pytest.approx(sums[str(row.model)] - best)
    differences = found["three"].elpd.elpd_i - found[table["model"].iloc[0]].elpd.elpd_i
    expected = np.sqrt(len(RECORDS) * float(differences.var(ddof=1)))
    assert table["difference_se"].iloc[-1] == pytest.approx(expected, rel=1e-6, abs=1e-9)
    of_best = found[table["model"].iloc[0]].elpd.elpd_i
    assert table["se"].iloc[0] == pytest.approx(np.sqrt(len(RECORDS) * float(of_best.var(ddof=1))))
    assert table["weight"].sum() == pytest.approx(1.0, abs=1e-6)
    assert set(table["verdict"]) == {"pass"}
    assert set(table["records"]) == {len(RECORDS)}


def test_a_difference_from_nothing_has_the_standard_error_of_what_it_is_from():
    """Two records, where the two divisors differ by a factor of 1.4."""
    two = ["a", "b"]
    found = {"one": made_up(np.array([3.0, 5.0]), two), "none": made_up(np.zeros(2), two)}
    table = compare(found, {"one": "pass", "none": "pass"})
    assert table["difference_se"].iloc[1] == pytest.approx(2.0)
    assert table["se"].iloc[0] == pytest.approx(2.0)


def test_the_sentence_tells_luck_from_more_than_luck(found):
    table = compare(found, PASS)
    first, second = table["model"].iloc[:2]
    said = sentence(table)
    assert f"{first} predicts a record left out best" in said
    assert f"cannot tell it from {second} (" in said
    assert f"{first} predicts a record left out better than three (-" in said
    alone = sentence(compare({name: found[name] for name in ("one", "three")}, PASS))
    assert "cannot tell" not in alone
    assert "by more than chance" in alone


@pytest.mark.parametrize(
    ("wrong", "verdicts"),
    [
        *(({"pareto_k": 0.9}, PASS), ({"effective": 5.0}, PASS), ({"disagreeing": True}, PASS)),
        ({"few_draws": True}, PASS),
        ({}, {**PASS, "one": "fail"}),
    ],
)
def test_what_cannot_be_trusted_fails(wrong, verdicts):
    table = compare({"one": made_up(elpd(1), RECORDS, **wrong), "two": made_up(elpd(2), RECORDS)}, verdicts)
    assert table.set_index("model")["verdict"].to_dict() == {"one": "fail", "two": "pass"}


def test_by_record_has_a_row_a_model_and_record(found):
    table = by_record(found)
    assert len(table) == 3 * len(RECORDS)
    assert table.groupby("model")["elpd"].sum()["one"] == pytest.approx(found["one"].elpd.elpd)


def test_densities_of_whole_recordings_are_compared_without_an_overflow():
    """A constant added to every model's density of a record changes no difference, weight or rank."""
    rng = np.random.default_rng(0)
    names = [f"r{i}" for i in range(8)]
    values = {"a": rng.standard_normal(8), "b": rng.standard_normal(8) - 0.5}
    far = {name: made_up(value + 7600.0, names) for name, value in values.items()}
    verdicts = dict.fromkeys(values, "pass")
    near, shifted = (compare(each, verdicts) for each in ({n: made_up(v, names) for n, v in values.items()}, far))
    assert shifted["elpd"].to_numpy() == pytest.approx(near["elpd"].to_numpy() + 8 * 7600.0, rel=1e-12)
    for column in ("elpd_difference", "difference_se", "weight"):
        np.testing.assert_allclose(shifted[column], near[column], rtol=1e-6, atol=1e-9)
    assert list(shifted["model"]) == list(near["model"])
