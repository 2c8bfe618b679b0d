"""`laws.csv`: sums and standard errors by hand, which law is said to carry the weight, and how often by chance."""

import numpy as np
import pytest
from scipy import stats

from bayes_tyre.inference.motion.hierarchy import law_pooling
from bayes_tyre.inference.motion.laws import MOTION_LAWS
from bayes_tyre.results.comparison.law_weights import WORDS, Evidence, laws_table, sentence

NAMES = ("fancher", "relaxing", "stiffening")
LOGS = np.array([[0.0, 8.0, 1.0], [0.0, 12.0, 3.0], [0.0, 9.0, 10.0], [0.0, 11.0, 2.0]])


def evidence(logs: np.ndarray, configuration: str = "dual", names: tuple[str, ...] = NAMES) -> Evidence:
    shares = np.exp(logs - np.nanmax(logs, axis=1, keepdims=True))
    own = shares / shares.sum(axis=1, keepdims=True)
    return Evidence(names, logs, np.isfinite(logs), own, np.repeat(configuration, len(logs)))


def test_each_law_of_the_average_has_words():
    assert tuple(WORDS) == MOTION_LAWS["auto"].averaged


def test_sums_errors_and_counts_are_those_by_hand():
    table = laws_table(evidence(7000.0 + LOGS), "simulated").set_index("law")
    assert table.index.tolist() == ["relaxing", "stiffening", "fancher"]
    assert table["log_evidence_difference"].tolist() == pytest.approx([0.0, -24.0, -40.0])
    for law, column in (("stiffening", 2), ("fancher", 0)):
        expected = np.sqrt(4 * np.var(LOGS[:, column] - LOGS[:, 1], ddof=1))
        assert table.loc[law, "difference_se"] == pytest.approx(expected)
    assert table["preferred"].tolist() == [3, 1, 0]
    assert table["weight"].sum() == pytest.approx(1.0)
    assert table["weight_by_record"].to_dict() == pytest.approx(
        dict(zip(NAMES, evidence(LOGS).own_weights.mean(axis=0), strict=True))
    )
    assert (table["records"] == 4).all()
    assert (table["left_out"] == 0).all()
    assert table["origin"].unique().tolist() == ["simulated"]


def test_few_records_must_differ_by_more_standard_errors():
    # Stiffening is behind by 24 with a standard error of 9.5: 2.5 of them, but of 3 degrees of freedom it takes 3.3.
    assert not laws_table(evidence(LOGS), "").decided.any()
    assert sentence(laws_table(evidence(LOGS), "")).endswith(
        "of dual, over 4 records the weights are relaxing 1.00, but no law is ahead by more than chance: relaxing has "
        "log evidence 24 ± 9.5 above that of stiffening"
    )
    assert laws_table(evidence(np.tile(LOGS, (3, 1))), "").decided.all()


def test_the_law_that_carried_the_weight_is_said_in_words_by_configuration():
    clear = np.array([[0.0, 8.0, 1.0], [0.0, 9.0, 1.0], [0.0, 10.0, 2.0]])
    both = [evidence(clear), evidence(clear[:1], "single")]
    joined = Evidence(NAMES, *(np.concatenate(parts) for parts in zip(*(each[1:] for each in both), strict=True)))
    table = laws_table(joined, "")
    assert table["configuration"].tolist() == ["dual"] * 3 + ["single"] * 3
    said = sentence(table).split("; ")
    assert said[0] == "force laws are averaged by the evidence of all records of a configuration"
    assert said[1] == (
        "of dual, over 3 records rubber that relaxes (relaxing) carried 1.00 of the weight: 3 prefer it, "
        "log evidence 23 ± 1 above that of stiffening"
    )
    assert said[2] == (
        "of single, over 1 record the weights are relaxing 1.00, but of one record there is no scatter to judge them "
        "by: relaxing has log evidence 7 above that of stiffening"
    )


def test_records_without_evidence_are_counted_and_where_none_has_it_that_is_said():
    logs = np.concatenate([LOGS, [[0.0, np.nan, 1.0]]])
    found = evidence(logs)
    table = laws_table(found, "")
    assert (table["records"] == 4).all()
    assert (table["left_out"] == 1).all()
    assert "1 left out for unreliable evidence" in sentence(table)
    assert table["weight_by_record"].notna().all()
    none = laws_table(found._replace(log_evidence=np.full(logs.shape, np.nan)), "")
    assert none["weight"].isna().all()
    assert not none["decided"].any()
    assert "no record has the evidence of each law" in sentence(none)
    # Each law has evidence of two of three records, and none has that of all laws.
    apart = laws_table(evidence(np.where(np.eye(3, dtype=bool), np.nan, 1.0)), "")
    assert (apart["records"] == 0).all()
    assert apart["weight"].isna().all()
    one_law = logs.copy()
    one_law[:, 1:] = np.nan
    assert "have the evidence of fancher alone" in sentence(laws_table(found._replace(log_evidence=one_law), ""))


@pytest.mark.parametrize("records", [3, 24])
def test_of_two_laws_that_are_alike_one_is_said_to_carry_the_weight_as_often_as_two_errors_mean(monkeypatch, records):
    """Both are wrong, and a record prefers either by chance: by 20, of either sign."""
    monkeypatch.setattr(law_pooling, "BOOTSTRAPS", 1000)  # of the weights, which do not decide it
    rng = np.random.default_rng(7)
    campaigns = 150
    said = 0
    for differences in rng.normal(0.0, 20.0, (campaigns, records)):
        logs = np.stack([np.zeros(records), differences], axis=1)
        said += bool(laws_table(evidence(logs, names=NAMES[:2]), "")["decided"].all())
    # Exactly 4.55 %, by Student's t, of normal differences: 7 of 150; none in 1 seed of 1,000, above 17 in 1 of 4,000.
    assert 0 < said <= stats.binom.ppf(1 - 2.5e-4, campaigns, 2 * stats.norm.sf(2.0))


def test_the_law_of_simulated_records_carries_the_weight():
    """The true law is ahead of each by 3 in the mean, by 2 more or less: its sum by 72 with a standard error of 10."""
    rng = np.random.default_rng(3)
    logs = rng.normal(0.0, np.sqrt(2.0), (24, 3)) + np.array([0.0, 3.0, 0.0])
    first = laws_table(evidence(logs), "").iloc[0]
    assert (first["law"], first["decided"]) == ("relaxing", True)
    assert first["weight"] > 0.99
