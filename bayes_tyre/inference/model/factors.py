"""The factors of a data set: records grouped into cases, and levels as index arrays for the models."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int
from scipy.linalg import helmert, null_space

from bayes_tyre.inference.model.record_levels import NO_LEVELS, RecordLevels
from bayes_tyre.record import CASE_FACTORS, Case

#: A slope over the initial force is given per this many kN: the distance of the source's nominal loads.
SLOPE_UNIT_KN = 10.0
#: Largest number in an orthonormal basis that is rounding error.
_ZERO = 1e-9
#: Interactions by name in `Factors`, of which some levels have no effect to be known (`Factor.free`).
INTERACTIONS = ("direction_step", "configuration_speed", "configuration_load")


@dataclass(frozen=True)
class Factor:
    """One grouping of the cases.

    Attributes
    ----------
    labels:
        The levels met in the data, sorted.
    of_case:
        Shape (cases,): which level a case belongs to.
    basis:
        Shape (levels, coordinates): orthonormal columns that span the effects the levels may have. Effects sum
        to zero: what levels share belongs to the term above them.
    weight:
        Shape (cases,): what multiplies the effect in each case; 1 but for a slope, whose one level is `per 10 kN`.
    """

    labels: tuple[object, ...]
    of_case: Int[np.ndarray, " cases"]
    basis: Float[np.ndarray, "levels coordinates"]
    weight: Float[np.ndarray, " cases"]

    @property
    def varies(self) -> bool:
        """Whether levels can differ: with one level a group the term would not be identified, and vanishes."""
        return self.basis.shape[1] > 0

    @property
    def free(self) -> Bool[np.ndarray, " levels"]:
        """Which levels have an effect that data can change; that of the others is zero, whatever the data.

        A size of step that was driven in one direction only has no interaction with the direction: the size's own
        effect holds all of it, and nothing is left that would be that direction's.
        """
        return np.abs(self.basis).max(axis=1, initial=0.0) > _ZERO

    @property
    def matrix(self) -> Float[np.ndarray, "cases coordinates"]:
        """What each coordinate adds to each case."""
        return self.basis[self.of_case] * self.weight[:, None]


@dataclass(frozen=True)
class Factors:
    """Cases, how they group, and which case each record repeats.

    Attributes
    ----------
    cases:
        In order of first appearance.
    group, speed, load, step, direction_step, configuration_speed, configuration_load:
        Groupings by configuration x direction, speed (km/h), initial load (kN; or a slope over the force that a
        step really started from), size of the step (kN), direction x size of the step, and configuration x speed
        and x initial load.
    of_record:
        Shape (records,): the case of each record.
    levels:
        What records share across cases.
    most_repeats:
        Records of the case that has most, which decides whether repeats can be discordant, and cases stand apart. Of
        some of the records (`only`) it is that of all of them: they have the same model.
    """

    cases: tuple[Case, ...]
    group: Factor
    speed: Factor
    load: Factor
    step: Factor
    direction_step: Factor
    configuration_speed: Factor
    configuration_load: Factor
    of_record: Int[np.ndarray, " records"]
    levels: RecordLevels = NO_LEVELS
    most_repeats: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "most_repeats", self.most_repeats or int(self.repeats.max(initial=0)))

    def only(self, records: Bool[np.ndarray, " records"] | Int[np.ndarray, " chosen"]) -> "Factors":
        """Return the factors of some of the records, by a mask or by their numbers; cases, levels and model stay."""
        return replace(self, of_record=self.of_record[records], levels=self.levels.only(records))

    @property
    def repeats(self) -> Int[np.ndarray, " cases"]:
        """Number of records of each case."""
        return np.bincount(self.of_record, minlength=len(self.cases))

    @property
    def repeats_to_sum_out(self) -> int:
        """Records of the case that has most, among these or all that `only` chose from: few enough can be summed out.

        Some of the records are thereby sampled as all are; records taken twice are counted twice.
        """
        return max(self.most_repeats, int(self.repeats.max(initial=0)))

    def effects(self, parameter: str) -> dict[str, Factor]:
        """Return what `k` or `beta` of a case depends on beside its group, by name; only what varies in the data.

        The size of the step acts on beta by direction too (Table 11: strongly in loading, little in unloading);
        speed and initial load act on k and beta by configuration too.
        """
        named = {"speed": self.speed, "load": self.load, "step": self.step}
        if parameter == "beta":
            named["direction_step"] = self.direction_step
        if parameter in ("k", "beta"):
            named |= {name: getattr(self, name) for name in ("configuration_speed", "configuration_load")}
        return {name: factor for name, factor in named.items() if factor.varies}

    def design(self, parameter: str) -> Float[np.ndarray, "cases terms"]:
        """Return the design matrix: the group of each case, and the coordinates of each factor's effects."""
        groups = np.eye(len(self.group.labels))[self.group.of_case]
        return np.concatenate([groups, *(factor.matrix for factor in self.effects(parameter).values())], axis=1)

    def has_remainder(self, parameter: str) -> bool:
        """Return whether cases can differ by more than their factors explain: not where these fit every case exactly.

        With one repeat a case the data cannot separate the remainder from the repeats' deviation; their priors do.
        """
        return self.spare_cases(parameter) > 0

    def spare_cases(self, parameter: str) -> int:
        """Return how many more cases there are than their factors can fit exactly."""
        effects = tuple(self.effects(parameter))
        if effects not in self._ranks:
            self._ranks[effects] = int(np.linalg.matrix_rank(self.design(parameter)))
        return len(self.cases) - self._ranks[effects]

    @cached_property
    def _ranks(self) -> dict[tuple[str, ...], int]:
        """Ranks of designs, by the names of their effects, once known: of hundreds of columns each takes a second."""
        return {}


def _factor(values: Sequence[Any]) -> Factor:
    labels = tuple(sorted(set(values), key=lambda value: (str(type(value)), value)))
    of_case = np.array([labels.index(value) for value in values], dtype=int)
    return Factor(labels, of_case, helmert(len(labels)).T, np.ones(len(of_case)))


def _slope(values: Float[np.ndarray, " cases"]) -> Factor:
    """Return the slope over a number (kN) that differs from case to case; no term where it does not differ."""
    centred = (values - values.mean()) / SLOPE_UNIT_KN
    basis = np.ones((1, int(np.ptp(values) > 0)))
    return Factor((f"per {SLOPE_UNIT_KN:g} kN",), np.zeros(len(values), dtype=int), basis, centred)


def _interaction(groups: Sequence[str], levels: Sequence[str], main: Factor) -> Factor:
    """Return the interaction of groups with a main factor: what neither says, so that none says it twice."""
    values = [f"{group} {level}".strip() for group, level in zip(groups, levels, strict=True)]
    if (main.weight != 1.0).any():
        return _slope_by_group(values, main)
    factor = _factor(values)
    first = [list(values).index(str(label)) for label in factor.labels]
    group = np.array([groups[case] for case in first])
    same = group[:, None] == group
    within = np.eye(len(group)) - same / same.sum(axis=1)
    other_effects = np.concatenate([same.astype(float), within @ main.basis[main.of_case[first]]], axis=1)
    return Factor(factor.labels, factor.of_case, null_space(other_effects.T), factor.weight)


def _slope_by_group(values: Sequence[str], slope: Factor) -> Factor:
    """Return how the slope of each group differs from the one of all; a group without a range has none."""
    factor = _factor(values)
    weights = [slope.weight[factor.of_case == group] for group in range(len(factor.labels))]
    ranged = np.flatnonzero([np.ptp(weight) > 0 for weight in weights])
    basis = np.zeros((len(factor.labels), max(0, len(ranged) - 1)))
    if len(ranged):
        basis[ranged] = helmert(len(ranged)).T
    return Factor(factor.labels, factor.of_case, basis, slope.weight)


def _with_identified(factors: Factors, interactions: dict[str, Factor]) -> Factors:
    """Return the factors with those interactions that the cases show beside all else, and leave a remainder beside.

    One that makes the terms fit every case exactly is the remainder of the cases by another name.
    """
    for name, factor in interactions.items():
        extended = replace(factors, **{name: factor})
        before, after = (int(np.linalg.matrix_rank(each.design("beta"))) for each in (factors, extended))
        if before < after < len(factors.cases):
            factors = extended
    return factors


def find_factors(factor_table: pd.DataFrame, initial_force_kN: Float[np.ndarray, " records"] | None = None) -> Factors:
    """Return the factors of a table, one row a record.

    Parameters
    ----------
    factor_table:
        As `bayes_tyre.record_table.record_factors` gives them. A word that the table lacks is one level: all records
        then share it. `repeat` is not used: records with the same factors are repeats of one case.
    initial_force_kN:
        The force each record really started from. Where given, `load` is a slope over its mean in each case,
        in place of an effect of each nominal initial load.
    """
    complete = factor_table.copy()
    for word in CASE_FACTORS:
        if word not in complete:
            complete[word] = "" if word in ("configuration", "direction") else np.nan
    # NaN is not equal to itself, which would make every record without the word a case of its own.
    keys = [
        tuple(None if pd.isna(value) else value for value in row) for row in complete[list(CASE_FACTORS)].to_numpy()
    ]
    number_of = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    cases = tuple(Case._make(np.nan if value is None else value for value in key) for key in number_of)
    sizes, speeds, loads = (
        ["" if np.isnan(value) else f"{abs(value):g}" for value in values]
        for values in zip(*((case.step_kN, case.speed_km_h, case.initial_load_kN) for case in cases), strict=True)
    )
    step, speed = _factor(sizes), _factor([_level(case.speed_km_h) for case in cases])
    of_record = np.array([number_of[key] for key in keys], dtype=int)
    load = _factor([_level(case.initial_load_kN) for case in cases])
    if initial_force_kN is not None:
        load = _slope(np.bincount(of_record, weights=initial_force_kN) / np.bincount(of_record))
        loads = [str(load.labels[0])] * len(cases)
    configurations, none = [case.configuration for case in cases], replace(step, basis=step.basis[:, :0])
    factors = Factors(
        cases=cases,
        group=_factor([case.group for case in cases]),
        speed=speed,
        load=load,
        step=step,
        direction_step=_interaction([case.direction for case in cases], sizes, step),
        configuration_speed=none,
        configuration_load=none,
        of_record=of_record,
    )
    by_configuration = {
        "configuration_speed": _interaction(configurations, speeds, speed),
        "configuration_load": _interaction(configurations, loads, load),
    }
    return _with_identified(factors, by_configuration)


def _level(value: float) -> object:
    """Return the value as a level; a missing one as text, for NaN is no level of its own."""
    return "" if np.isnan(value) else value
