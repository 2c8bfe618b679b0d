"""What a reader asks of a posterior in passing: its setting for figures, its average ratios."""

from collections.abc import Iterable

import pandas as pd
import xarray as xr

from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.wording import probability_text

_SHOWN = (
    *("contrast", "matching", "configuration", "direction"),
    *("median", "lower", "upper", "p_greater_than_1", "origin"),
)


def setting(tree: xr.DataTree) -> Setting:
    """Return what figures of a posterior share; its verdict is judged where it does not carry one."""
    configurations = {case.configuration or "" for case in tree_cases(put_together(tree)["posterior"].to_dataset())}
    verdict = tree.attrs.get("verdict") or diagnose(tree).verdict
    return Setting(tree.attrs["origin"], verdict, tuple(sorted(configurations)))


def average_table(contrasts: Iterable[pd.DataFrame], parameter: str) -> pd.DataFrame:
    """Return the average ratios of k or beta in several tables of `contrasts.csv`, rounded to read, no unit.

    Columns `contrast`, `matching`, `configuration`, `direction`, `median`, `lower`, `upper`, `P(ratio > 1)`, `origin`.
    """
    table = pd.concat(list(contrasts), ignore_index=True)
    averages = table[(table["parameter"] == parameter) & table[list(CASE_FACTORS[2:])].isna().all(axis=1)]
    shown = averages[list(_SHOWN)].fillna("").sort_values(["contrast", "matching"], kind="stable").round(2)
    shown["p_greater_than_1"] = averages["p_greater_than_1"].map(probability_text)
    return shown.rename(columns={"p_greater_than_1": "P(ratio > 1)"}).set_index(["contrast", "matching"])
