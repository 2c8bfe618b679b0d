"""A finished result as the document shows it: what its folder holds, read once and checked for shape."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.comparison.law_weights import LAWS_CSV
from bayes_tyre.results.contrasts import check_reference, with_reference
from bayes_tyre.results.provenance import RUN_JSON

VERDICTS = ("pass", "fail")
#: What `summary.csv` puts behind a parameter's name where it is its mean over cases.
MEAN = "_mean"
TABLES = ("summary", "cases", "contrasts", "repeats")
_NUMBERS = ("median", "lower", "upper", "interval")
#: The numbers of `laws.csv` that the page shows.
LAW_NUMBERS = ("weight", "weight_by_record", "preferred", "log_evidence_difference", "difference_se", "records")
#: What no table of the name can do without.
_NEEDED = {
    "summary": ("parameter", *_NUMBERS),
    "cases": ("parameter", "unit", *_NUMBERS),
    "contrasts": ("contrast", "matching", "parameter", *_NUMBERS, "p_greater_than_1"),
    "repeats": ("record", "parameter", "unit", *_NUMBERS, "outlier_probability"),
}
_RUN: dict[str, type | tuple[type, ...]] = {
    "command": str,
    "options": dict,
    "seed": int,
    "origin": str,
    "versions": dict,
    "inputs": dict,
    "wall_time_s": (int, float),
}


@dataclass(frozen=True)
class Reported:
    """What a result's folder says.

    Attributes
    ----------
    name:
        What the document calls it.
    run, diagnostics:
        `run.json` and `diagnostics.json`.
    summary, cases, contrasts, repeats:
        The tables of these names: factors as text (empty where missing), numbers as float (NaN where missing).
    laws:
        `laws.csv` of an average over force laws; None of another result.
    reference:
        The configuration that others are compared with, the lower one of their ratios; empty where none was named.
    """

    name: str
    run: dict[str, Any]
    diagnostics: dict[str, Any]
    summary: pd.DataFrame
    cases: pd.DataFrame
    contrasts: pd.DataFrame
    repeats: pd.DataFrame
    laws: pd.DataFrame | None = None
    reference: str = ""

    @property
    def verdict(self) -> str:
        """``pass`` or ``fail``."""
        return self.diagnostics["verdict"]

    @property
    def origins(self) -> list[str]:
        """What kinds of data it rests on, such as ``["measured", "simulated"]``."""
        return [part.strip() for part in self.run["origin"].split(" + ")]

    @property
    def interval(self) -> float:
        """Probability of its intervals, equal-tailed."""
        return float(self.cases["interval"].iloc[0])

    @property
    def configurations(self) -> list[str]:
        """Its configurations in sorted order; an empty text where the data name none."""
        return sorted(self.cases["configuration"].unique())

    @property
    def parameters(self) -> list[str]:
        """The parameters of its tables, those of the cases first."""
        return list(dict.fromkeys([*self.cases["parameter"], *self.repeats["parameter"]]))

    @property
    def of_motions(self) -> bool:
        """Whether its cases have what only a motion tells: friction, mass, damping, energy lost."""
        return bool(self.cases["parameter"].isin(["x", "energy_per_cycle"]).any())

    def means(self, parameter: str) -> pd.DataFrame:
        """Return the rows of `summary.csv` with a parameter's mean over cases, one a configuration and direction."""
        return self.summary[self.summary["parameter"] == f"{parameter}{MEAN}"]

    def referred_to(self, reference: str | None) -> "Reported":
        """Return the result with a configuration as the lower one of its ratios; None: as it is.

        Raises
        ------
        BadInput
            If no case has that configuration.
        """
        if reference is None:
            return self
        check_reference(reference, self.configurations)
        return replace(
            self, reference=reference, contrasts=with_reference(self.contrasts, reference, self.configurations)
        )

    def sentences(self, kind: str) -> list[str]:
        """Return the sentences in `diagnostics.json` under ``reasons`` or ``limitations``."""
        entries = self.diagnostics.get(kind)
        return [each for each in entries if isinstance(each, str)] if isinstance(entries, list) else []


def read_reported(folder: Path, name: str, run: dict[str, Any] | None = None) -> Reported:
    """Return what is in the folder of a finished result; of one that is being written, `run` says what it rests on.

    Raises
    ------
    BadInput
        If the folder holds no finished result, or a file that no fit wrote.
    """
    if run is None:
        if not (folder / RUN_JSON).is_file():
            raise BadInput(
                f"{folder}: holds no run.json, so no finished result; name a folder that fit or motion wrote"
            )
        run = _object(folder / RUN_JSON, _RUN)
    diagnostics = _object(folder / "diagnostics.json", {"verdict": str})
    if diagnostics["verdict"] not in VERDICTS:
        raise BadInput(f"{folder / 'diagnostics.json'}: does not say a verdict; run fit again")
    tables = {table: _table(folder / f"{table}.csv", table) for table in TABLES}
    laws = _laws(folder / LAWS_CSV) if (folder / LAWS_CSV).is_file() else None
    return Reported(name, run, diagnostics, **tables, laws=laws, reference=str(run["options"].get("reference") or ""))


def _object(path: Path, needed: dict[str, Any]) -> dict[str, Any]:
    try:
        content = read_json(path)
        complete = isinstance(content, dict) and all(
            isinstance(content.get(name), kind) for name, kind in needed.items()
        )
    except (OSError, ValueError):
        complete = False
    if not complete:
        raise BadInput(f"{path}: is not what fit writes; run fit again")
    return content


def _laws(path: Path) -> pd.DataFrame:
    read = read_table(path)
    if missing := [column for column in ("law", *LAW_NUMBERS) if column not in read]:
        raise BadInput(f"{path}: is not what motion writes: no column {missing[0]}; run motion again")
    factors = {column: texts(read, column) for column in ("configuration", "law")}
    return pd.DataFrame({**factors, **{column: numbers(read, column) for column in LAW_NUMBERS}})


def _table(path: Path, name: str) -> pd.DataFrame:
    read = read_table(path)
    missing = [column for column in _NEEDED[name] if column not in read]
    if missing:
        raise BadInput(f"{path}: is not what fit writes: no column {missing[0]}; run fit again")
    factor_names = ("record", *CASE_FACTORS[:2], "parameter", "unit", "contrast", "matching", "decided_by", "limit")
    measures = (*CASE_FACTORS[2:], "repeat", *_NUMBERS, "p_greater_than_1", "outlier_probability", "r_hat", "p_limit")
    table = pd.DataFrame(
        {
            **{factor: texts(read, factor) for factor in factor_names},
            **{column: numbers(read, column) for column in measures},
        }
    )
    if name in ("summary", "cases") and not table[list(_NUMBERS)].notna().all(axis=1).any():
        raise BadInput(f"{path}: is not what fit writes: no numbers below the header; run fit again")
    return table
