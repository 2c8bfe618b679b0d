"""A case without one of its records: the draws weighed anew, where the answer is known by hand."""

import numpy as np
import pytest
from helpers.hand_made_posteriors import posterior
from helpers.simulated_records import Plan, simulate
from support.without_record import case_without

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record_table import check_record_table, record_factors

#: Of log k: the posterior's standard deviation, the repeats' scatter, the record's distance from the posterior's mean.
SD, SCATTER, AWAY = 0.05, 0.1, 0.05
CHAINS, DRAWS = 2, 4000


@pytest.fixture(scope="module")
def made():
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (10.0,), repeats=3, points=60), seed=3)
    table = check_record_table(table)
    table = table[table["direction"] == table["direction"].iloc[0]].reset_index(drop=True)
    batch = prepare_records(table, ModelSettings()).batch
    log_k, log_beta = np.asarray(estimate_records(batch, "iid", None).centre)[0, 2:]
    rng = np.random.default_rng(8)

    def known(value: float) -> np.ndarray:
        return np.full((CHAINS, DRAWS), value)

    draws = {
        "k_case": np.exp(log_k - AWAY + SD * rng.standard_normal((CHAINS, DRAWS, 1))),
        "beta_case": np.exp(log_beta + np.zeros((CHAINS, DRAWS, 1))),
        **{"sd_log_k_repeat": known(SCATTER), "sd_log_beta_repeat": known(0.2)},
        **{"sd_J": known(1.0), "sigma_typical": known(0.03), "sd_log_sigma": known(0.2)},
    }
    tree = posterior(draws, record_factors(table))
    tree.attrs |= {"repeats": "normal", "noise": "iid"}
    return tree, table, batch.records, log_k


def test_the_case_is_what_the_other_records_say(made):
    tree, table, records, log_k = made
    rows = case_without(tree, table, records[0]).query("parameter == 'k'").set_index("records")
    assert rows["trusted"].all()
    k = rows[["median", "lower", "upper", "pareto_k"]].astype(float).to_dict("index")
    assert k["without"]["pareto_k"] < 0.7
    # The record's factor, normal in log k, is taken off the posterior's: precisions and weighted means subtract.
    precision = SD**-2 - SCATTER**-2
    mean = log_k - AWAY - AWAY * SCATTER**-2 / precision
    assert np.log(k["with"]["median"]) == pytest.approx(log_k - AWAY, abs=0.004)
    # 8000 draws: a median's standard error is below 0.001, a 95 % interval's end's below 0.002; five of them.
    assert np.log(k["without"]["median"]) == pytest.approx(mean, abs=0.005)
    for end, sign in (("lower", -1), ("upper", 1)):
        assert np.log(k["without"][end]) == pytest.approx(mean + sign * 1.96 * precision**-0.5, abs=0.01)


def test_a_record_that_is_not_there_is_told(made):
    tree, table, _, _ = made
    with pytest.raises(BadInput, match="'nobody' is not in the table"):
        case_without(tree, table, "nobody")
