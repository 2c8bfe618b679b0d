"""One figure of a posterior, by the name of its file in `figures/`."""

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from bayes_tyre.errors import BadInput
from bayes_tyre.report.figures.catalogue import ALWAYS, OF_MOTIONS, OF_RECORDS, OF_REPEATS, Result


def chosen_figure(
    tree: xr.DataTree,
    verdict: str,
    name: str,
    table: pd.DataFrame | None = None,
    printed: pd.DataFrame | None = None,
    interval: float = 0.95,
) -> Figure:
    """Return a figure that `bayes_tyre.report.figures.catalogue` knows.

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
        For a name that there is not, a figure of records without records, and one of odd repeats where none is judged.
    """
    result = Result(tree, verdict, table, printed, interval)
    of_tree = {**ALWAYS, **OF_MOTIONS} if result.of_motions else ALWAYS
    known = [*of_tree, *([] if result.of_motions else OF_RECORDS), *OF_REPEATS]
    if name not in known:
        raise BadInput(f"figure {name!r} is unknown; use one of {', '.join(known)}")
    if name in of_tree:
        return of_tree[name](result)
    if name in OF_REPEATS and result.judges:
        return OF_REPEATS[name](result)
    if name in OF_RECORDS and table is not None and "record" in tree["posterior"].dims:
        return OF_RECORDS[name](result, table)
    if name in OF_REPEATS and "record" in tree["posterior"].dims:
        raise BadInput(f"figure {name}: this posterior judges no record; that takes repeats mixture, three of a case")
    raise BadInput(f"figure {name} shows records; give the posterior of records, and their table")
