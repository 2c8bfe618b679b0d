"""Quantities in the user's terms: every name that a posterior can have, and words that are none."""

import pytest

from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.report.answer.quantities import in_words


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("k_group[dual loading]: not determined", "stiffness k of dual loading: not determined"),
        ("J_group[dual loading]: wide", "mean of J of dual loading: wide"),
        ("log_k_speed[35]: prior-sensitive", "effect of 35 km/h on stiffness k: prior-sensitive"),
        ("k_case[a [b] c], sigma[r 1] and 4 more", "stiffness k of a [b] c, noise sigma of r 1 and 4 more"),
        ("most at large sd_log_beta_repeat)", "most at large standard deviation of log beta between repeats)"),
        ("k_case: probably apart from the others", "stiffness k of cases: probably apart from the others"),
        ("sd_log_k_repeat_by_speed[15]", "standard deviation of log k between repeats at 15 km/h"),
        ("energy of a cycle failed: KeyError: no 'student_nu'", "energy of a cycle failed: KeyError: no 'student_nu'"),
        ("R-hat 1.2 of chain 2: raise --warmup; k and beta", "R-hat 1.2 of chain 2: raise --warmup; k and beta"),
    ],
)
def test_names_become_words_and_all_else_stays(sentence, words):
    assert in_words(sentence) == words


def test_no_name_of_a_posterior_is_left_as_it_is():
    labelled = [name if dim is None else f"{name}[10]" for name, (dim, _) in QUANTITIES.items()]
    left = [name for name in labelled if in_words(name) == name]
    assert left == []
