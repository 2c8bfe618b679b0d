"""Why a model of a comparison is not to be trusted, with what has not been done yet."""

import numpy as np
import pytest
from helpers.left_out import made_up

from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.workflow.from_results import compare

RECORDS = [f"r{i}" for i in range(20)]
ELPD = np.random.default_rng(1).normal(50.0, 1.0, len(RECORDS))


@pytest.mark.parametrize(
    ("doubtful", "refit", "advice"),
    [
        ({"pareto_k": 0.9}, False, "compare without --no-refit"),
        ({"pareto_k": 0.9}, True, "a fit without a record failed; leave the model out"),
        ({"effective": 9.0}, False, "fewer than 20 points are too few for its records; leave the model out"),
        ({"effective": 9.0}, True, "fewer than 20 points are too few for its records; leave the model out"),
    ],
)
def test_advice_is_what_was_not_done(doubtful, refit, advice, monkeypatch, tmp_path):
    predicted = {"sound": made_up(ELPD, RECORDS), "doubtful": made_up(ELPD - 1.0, RECORDS, **doubtful)}
    models = {name: compare._Model(SamplerSettings(), lambda *_, each=each: each) for name, each in predicted.items()}
    monkeypatch.setattr(compare, "_models", lambda *_: (models, dict.fromkeys(models, "pass")))
    done = compare.compare_folders([tmp_path / name for name in models], tmp_path, refit=refit)
    (reason,) = done.untrusted
    assert reason.startswith("doubtful: the posterior passed, its elpd is not to be trusted")
    assert reason.endswith(f"; {advice}")


@pytest.mark.parametrize(
    ("doubtful", "says"),
    [
        ({"pareto_k": 0.9}, "Pareto k of a case is 0.90 (0 cases fitted again)"),
        ({"disagreeing": True}, "chains of 20 of these fits disagree"),
        ({"few_draws": True}, "20 of them have fewer than 50 effective draws"),
    ],
)
def test_a_model_that_fails_by_its_cases_alone_is_told_why(doubtful, says, monkeypatch, tmp_path):
    sound, failing = made_up(ELPD, RECORDS), made_up(ELPD - 1.0, RECORDS, **doubtful)
    models = {
        "sound": compare._Model(SamplerSettings(), lambda *_: sound, lambda *_: sound),
        "doubtful": compare._Model(SamplerSettings(), lambda *_: sound, lambda *_: failing),
    }
    monkeypatch.setattr(compare, "_models", lambda *_: (models, dict.fromkeys(models, "pass")))
    done = compare.compare_folders([tmp_path / name for name in models], tmp_path)
    (reason,) = done.untrusted
    assert reason.startswith("doubtful: the posterior passed, its elpd of cases is not to be trusted: ")
    assert says in reason
    monkeypatch.setattr(compare, "_models", lambda *_: (models, {"sound": "pass", "doubtful": "fail"}))
    (reason,) = compare.compare_folders([tmp_path / name for name in models], tmp_path).untrusted
    assert "diagnostics.json says why" in reason
