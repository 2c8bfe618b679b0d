"""What a limit's probabilities are in sentences, a case each."""

import pandas as pd

from bayes_tyre.plain_text import one_line
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.wording import probability_text, text_name
from bayes_tyre.results.columns import numbers

#: Sentences where a case a line would be too long to read.
MOST_SENTENCES = 6
_SIDES = {">=": "at least", "<=": "at most"}


def limit_sentences(cases: pd.DataFrame, most: int | None = None) -> list[str]:
    """Return how probable it is that each case keeps its limit, the least probable first; nothing without a limit.

    Parameters
    ----------
    cases:
        As `cases.csv` holds them.
    most:
        How many cases get a sentence; None: all.
    """
    with_limit = cases.assign(p_limit=numbers(cases, "p_limit")).dropna(subset="p_limit")
    rows = with_limit.sort_values("p_limit", kind="stable").to_dict("records")
    sentences = [_sentence({str(name): value for name, value in row.items()}) for row in rows[:most]]
    left = len(rows) - len(sentences)
    return [*sentences, f"{left} more cases keep it with higher probability: cases.csv"] if left else sentences


def _sentence(row: dict[str, object]) -> str:
    parameter, sign, value = str(row["limit"]).split()
    bound = f"is {_SIDES[sign]} {float(value):g} {row['unit']}"
    probability = probability_text(float(str(row["p_limit"])), 2)
    return one_line(f"{text_name(parameter)} of {_case(row)} {bound} with probability {probability}", 300)


def _case(row: dict[str, object]) -> str:
    """Return a case in words, such as ``dual loading at 35 km/h from 30 to 40 kN``, as far as it is given."""
    given = {name: row[name] for name in CASE_FACTORS if row[name] == row[name] and row[name] not in ("", None)}
    sizes = {name: float(str(value)) for name, value in given.items() if name not in ("configuration", "direction")}
    names = [str(given[name]) for name in ("configuration", "direction") if name in given]
    texts = names or ["all records"]
    if "speed_km_h" in sizes:
        texts.append(f"at {sizes['speed_km_h']:g} km/h")
    if {"initial_load_kN", "step_kN"} <= sizes.keys():
        start = sizes["initial_load_kN"]
        texts.append(f"from {start:g} to {start + sizes['step_kN']:g} kN")
    else:
        parts = {"initial_load_kN": "from {:g} kN", "step_kN": "in steps of {:+g} kN"}
        texts += [text.format(sizes[name]) for name, text in parts.items() if name in sizes]
    return " ".join(texts)
