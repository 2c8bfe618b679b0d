"""The probability that a parameter of a case keeps a limit, such as ``k >= 1.8``."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.datatree import case_parameters
from bayes_tyre.plain_text import number_in, quoted
from bayes_tyre.record import AXLE_PARAMETERS, ENERGY, LAW_PARAMETERS
from bayes_tyre.results.contrasts import probability_of

_FORM = re.compile(r"\s*(?P<parameter>[A-Za-z_]+)\s*(?P<sign>>=|<=)\s*(?P<value>\S+)\s*")
#: What a limit can be on: the parameters that cases of a fit have, and all, with those of motions.
OF_RECORDS = ("k", "beta")
LIMITED = (*LAW_PARAMETERS, *AXLE_PARAMETERS, ENERGY)


class Limit(NamedTuple):
    """A limit on a parameter, in its unit: ``>=`` or ``<=``."""

    parameter: str
    sign: str
    value: float

    @property
    def text(self) -> str:
        """The limit as it is given, such as ``k >= 1.8``."""
        return f"{self.parameter} {self.sign} {self.value!r}"


def parse_limit(text: str, among: Sequence[str] = LIMITED) -> Limit:
    """Return the limit that a text such as ``k >= 1.8`` states.

    Raises
    ------
    BadInput
        For anything else, and for what is no parameter `among` these.
    """
    form = _FORM.fullmatch(text)
    value = number_in(form["value"]) if form else None
    if form is None or value is None or not math.isfinite(value):
        raise BadInput(f"{quoted(text)} is no limit; give PARAMETER >= NUMBER or <= NUMBER, such as 'k >= 1.8' (kN/mm)")
    if form["parameter"] not in among:
        raise BadInput(
            f"{quoted(form['parameter'])} is no parameter of a case here; give a limit on {', '.join(among)}"
        )
    return Limit(form["parameter"], form["sign"], value)


def with_limit(cases: pd.DataFrame, tree: xr.DataTree, limit: Limit) -> pd.DataFrame:
    """Return `cases.csv` with `limit` and `p_limit`, the probability of each case to keep it; empty for other rows.

    Raises
    ------
    BadInput
        If the cases of the posterior do not have the parameter.
    """
    posterior = tree["posterior"].to_dataset()
    if limit.parameter not in (has := case_parameters(posterior)):
        raise BadInput(f"--limit {limit.text}: no case here has {limit.parameter}; give one on {', '.join(has)}")
    draws = posterior[f"{limit.parameter}_case"].transpose("chain", "draw", "case").to_numpy()
    keeps = draws >= limit.value if limit.sign == ">=" else draws <= limit.value
    mine = cases["parameter"] == limit.parameter
    probabilities = np.full(len(cases), np.nan)
    probabilities[mine] = [probability_of(keeps[..., case]) for case in range(draws.shape[-1])]
    last = cases[["origin", "verdict"]]
    table = cases.drop(columns=list(last)).assign(limit=np.where(mine, limit.text, ""), p_limit=probabilities)
    return pd.concat([table, last], axis=1)
