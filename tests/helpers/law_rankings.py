"""Made-up results of the study of laws: the true law first, every other 10 ± 2 behind."""

from collections.abc import Sequence

import pandas as pd

from bayes_tyre.studies.law_ranking import RANKED_LAWS, Ranked


def ranked(true_laws: Sequence[str], first: str | None = None) -> Ranked:
    """Return what the study would; `first`: another law that comes first."""
    rows = []
    for true in true_laws:
        best = first or true
        for rank, name in enumerate((best, *(law for law in RANKED_LAWS if law != best)), start=1):
            far = -10.0 if rank > 1 else 0.0
            rows.append(
                {"true_law": true, "fitted_law": name, "rank": rank, "elpd": 100.0 + far, "elpd_difference": far}
                | {"difference_se": 2.0 if rank > 1 else 0.0, "is_or_contains": name == true}
                | {"first_within_2_se": rank == 1, "origin": "simulated"}
            )
    table = pd.DataFrame(rows)
    return Ranked(table, table[["true_law", "fitted_law", "elpd", "origin"]].assign(record="S(0)30-20(1)"))
