"""Limits in sentences: the least probable first, cases in words, a few of many."""

import numpy as np
import pandas as pd

from bayes_tyre.report.limits import limit_sentences


def rows(**changes) -> pd.DataFrame:
    one = {
        "configuration": "dual",
        "direction": "loading",
        "speed_km_h": 35.0,
        "initial_load_kN": 30.0,
        "step_kN": 10.0,
    }
    return pd.DataFrame([one | {"parameter": "k", "unit": "kN/mm", "limit": "k >= 1.8", "p_limit": 0.93} | changes])


def test_a_case_is_named_by_the_factors_that_it_has():
    (whole,) = limit_sentences(rows())
    assert whole == "k of dual loading at 35 km/h from 30 to 40 kN is at least 1.8 kN/mm with probability 0.93"
    unknown = {"speed_km_h": np.nan, "direction": "", "limit": "k <= 2.0"}
    (bare,) = limit_sentences(rows(initial_load_kN=np.nan, step_kN=np.nan, **unknown))
    assert bare == "k of dual is at most 2 kN/mm with probability 0.93"
    (step,) = limit_sentences(rows(initial_load_kN=np.nan, step_kN=-5.0, **unknown))
    assert step == "k of dual in steps of -5 kN is at most 2 kN/mm with probability 0.93"
    (load,) = limit_sentences(rows(step_kN=np.nan, **unknown))
    assert load == "k of dual from 30 kN is at most 2 kN/mm with probability 0.93"
    nothing = {"configuration": "", "direction": None, "speed_km_h": "", "initial_load_kN": "", "step_kN": ""}
    assert limit_sentences(rows(**nothing))[0].startswith("k of all records is")


def test_the_least_probable_comes_first_and_the_rest_is_counted():
    shares = [0.9996, 0.2, "", 0.5, 0.7]  # as a table from disk holds them, a row of another parameter without
    table = pd.concat([rows(p_limit=share, speed_km_h=float(i)) for i, share in enumerate(shares)])
    everything = limit_sentences(table)
    assert [sentence.rsplit(" ", 1)[1] for sentence in everything] == ["0.20", "0.50", "0.70", "0.9996"]
    assert everything[-1].endswith("with probability >= 0.9996")
    assert limit_sentences(table, 2) == [*everything[:2], "2 more cases keep it with higher probability: cases.csv"]


def test_without_a_limit_there_is_nothing_to_say():
    assert limit_sentences(rows().drop(columns=["limit", "p_limit"])) == []


def test_a_name_from_a_file_stays_on_one_line():
    (sentence,) = limit_sentences(rows(configuration="two\nlines\x1b[31m"))
    assert sentence.isprintable()
