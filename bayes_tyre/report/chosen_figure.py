"""One figure of a posterior, by the name of its file in `figures/`."""

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.posterior import is_of_motions
from bayes_tyre.report import summary
from bayes_tyre.report.figures import ALWAYS, OF_MOTIONS, OF_RECORDS, Result


def chosen_figure(
    tree: xr.DataTree,
    verdict: str,
    name: str,
    table: pd.DataFrame | None = None,
    printed: pd.DataFrame | None = None,
    interval: float = 0.95,
) -> Figure:
    """Return a figure that `bayes_tyre.report.figures` knows.

    Parameters
    ----------
    tree, verdict:
        A posterior, and ``pass`` or ``fail``.
    name:
        Of its file, without suffix.
    table:
        The points it was fitted to; figures of records need them.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case, shown beside the posterior where given.
    interval:
        Probability of every interval, equal-tailed.

    Raises
    ------
    BadInput
        For a name that there is not, and a figure of records without records.
    """
    motions = is_of_motions(tree["posterior"].to_dataset())
    of_tree = {**ALWAYS, **OF_MOTIONS} if motions else ALWAYS
    known = [*of_tree] if motions else [*of_tree, *OF_RECORDS]
    if name not in known:
        raise BadInput(f"figure {name!r} is unknown; use one of {', '.join(known)}")
    if name not in of_tree and ("record" not in tree["posterior"].dims or table is None):
        raise BadInput(f"figure {name} shows records; give the posterior of records, and their table")
    cases, repeats = summary.cases(tree, verdict, interval), summary.repeats(tree, verdict, interval)
    result = Result(tree, verdict, cases, repeats, table, printed, interval)
    return of_tree[name](result) if table is None or name in of_tree else OF_RECORDS[name](result, table)
