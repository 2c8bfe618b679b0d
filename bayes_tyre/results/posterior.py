"""A posterior that shows itself as its table and verdict: still a DataTree, whatever is done with it."""

from html import escape

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.formats.constant_data import put_together, set_apart
from bayes_tyre.inference.sampling.group_means import group_means
from bayes_tyre.record import RECORD_UNITS

INTERVAL = 0.95
_WHY = "bt.diagnose says why the verdict is fail, and what to do; do not use the numbers before\n"
_USE = "bt.cases, bt.contrasts, bt.repeats, bt.diagnose and bt.figure take it"


class Posterior(xr.DataTree):
    """A posterior as ArviZ keeps it, whose text is the mean parameters with their intervals, and the verdict.

    ``posterior.posterior`` is the dataset of draws; ``xarray.DataTree.__repr__(posterior)`` shows the whole tree.
    """

    __slots__ = ()

    @classmethod
    def of(cls, tree: xr.DataTree) -> "Posterior":
        """Return a tree as such a posterior, factors in `constant_data`; its data are not copied."""
        tree = set_apart(tree)
        return cls(tree.to_dataset(), dict(tree.children), name=tree.name)

    def __repr__(self) -> str:
        """Return the table and the verdict."""
        table = means_table(self).to_string(index_names=False).splitlines()
        return "\n".join([self._about(), "", *map(str.rstrip, table), "", self._use()])

    def __str__(self) -> str:
        """Return the table and the verdict."""
        return repr(self)

    def _repr_html_(self) -> str:
        """Return the table and the verdict as HTML; labels are text, never markup."""
        return (
            f"<p>{escape(self._about())}</p>{means_table(self).to_html(index_names=False)}<p>{escape(self._use())}</p>"
        )

    def _use(self) -> str:
        return f"{_WHY if self.attrs.get('verdict') == 'fail' else ''}{_USE}"

    def _about(self) -> str:
        posterior = self["posterior"]
        records = f"{posterior.sizes['record']} records" if "record" in posterior.dims else "printed tables"
        draws = f"{posterior.sizes['chain']} chains of {posterior.sizes['draw']} draws"
        verdict, origin = self.attrs.get("verdict", "none"), self.attrs["origin"]
        return (
            f"Posterior of {records} (data: {origin}), {draws}; verdict: {verdict}\n"
            f"mean over the cases, median and {100 * INTERVAL:g} % interval"
        )


def means_table(tree: xr.DataTree) -> pd.DataFrame:
    """Return the mean parameters over the cases as text, a row a parameter and direction, a column a configuration."""
    means = group_means(put_together(tree))
    tails = [(1.0 - INTERVAL) / 2.0, 0.5, (1.0 + INTERVAL) / 2.0]
    factors = [means[name].fillna("").to_numpy() for name in ("configuration", "direction")]
    cells: dict[str, dict[tuple[str, str], str]] = {}
    for name, draws in means.data_vars.items():
        by_group = np.quantile(draws.to_numpy(), tails, axis=(0, 1)).T
        for configuration, direction, (lower, median, upper) in zip(*factors, by_group, strict=True):
            row = f"{name}, {RECORD_UNITS[str(name)]}", str(direction or "")
            cells.setdefault(str(configuration or ""), {})[row] = f"{median:.4g} [{lower:.4g}, {upper:.4g}]"
    # As the terminal has them: what the others are compared with comes first.
    return pd.DataFrame(cells)[sorted(cells, reverse=True)].fillna("")
