"""The levels that the data hold: words of records turned into cases, and cases into index arrays for the models."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Int

from bayes_tyre.record import CASE_WORDS, Case


@dataclass(frozen=True)
class Factor:
    """One grouping of the cases.

    Attributes
    ----------
    labels:
        The levels met in the data, sorted.
    of_case:
        Shape (cases,): which level a case belongs to.
    """

    labels: tuple[object, ...]
    of_case: Int[np.ndarray, " cases"]

    @property
    def varies(self) -> bool:
        """Whether there is more than one level: with one, its term would not be identified and vanishes."""
        return len(self.labels) > 1


@dataclass(frozen=True)
class Levels:
    """Cases, how they group, and which case each record repeats.

    Attributes
    ----------
    cases:
        In order of first appearance.
    cell, speed, load, step, direction_step:
        Groupings by configuration x direction, speed (km/h), initial load (kN), size of the step (kN), and
        direction x size of the step.
    of_record:
        Shape (records,): the case of each record.
    """

    cases: tuple[Case, ...]
    cell: Factor
    speed: Factor
    load: Factor
    step: Factor
    direction_step: Factor
    of_record: Int[np.ndarray, " records"]

    @property
    def repeats(self) -> Int[np.ndarray, " cases"]:
        """Number of records of each case."""
        return np.bincount(self.of_record, minlength=len(self.cases))

    @property
    def directions_differ_in_step(self) -> bool:
        """Whether direction x step says more than direction and step alone can."""
        return self.step.varies and len({case.direction for case in self.cases}) > 1


def _factor(values: list[object]) -> Factor:
    labels = tuple(sorted(set(values), key=lambda value: (str(type(value)), value)))
    return Factor(labels, np.array([labels.index(value) for value in values], dtype=int))


def find_levels(words: pd.DataFrame) -> Levels:
    """Return the levels in a table of words, one row a record.

    Parameters
    ----------
    words:
        As `bayes_tyre.record.record_words` gives them. A word that the table lacks is one level: all records
        then share it. `repeat` is not used: records with the same words are repeats of one case.
    """
    complete = words.copy()
    for word in CASE_WORDS:
        if word not in complete:
            complete[word] = "" if word in ("configuration", "direction") else np.nan
    # NaN is not equal to itself, which would make every record without the word a case of its own.
    keys = [tuple(None if pd.isna(value) else value for value in row) for row in complete[list(CASE_WORDS)].to_numpy()]
    unique = list(dict.fromkeys(keys))
    cases = tuple(Case(*(np.nan if value is None else value for value in key)) for key in unique)
    sizes = ["" if np.isnan(case.step_kN) else f"{abs(case.step_kN):g}" for case in cases]
    return Levels(
        cases=cases,
        cell=_factor([f"{case.configuration} {case.direction}".strip() for case in cases]),
        speed=_factor([str(case.speed_km_h) if np.isnan(case.speed_km_h) else case.speed_km_h for case in cases]),
        load=_factor(
            [str(case.initial_load_kN) if np.isnan(case.initial_load_kN) else case.initial_load_kN for case in cases]
        ),
        step=_factor(sizes),
        direction_step=_factor([f"{case.direction} {size}".strip() for case, size in zip(cases, sizes, strict=True)]),
        of_record=np.array([unique.index(key) for key in keys], dtype=int),
    )
