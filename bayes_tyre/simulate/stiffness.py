"""The stiffness that a simulated case is given: the printed one, or one that follows from printed ones."""

import functools

import numpy as np

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.record import CASE_FACTORS, Case


def case_stiffness(case: Case) -> float:
    """Return a case's stiffness k, kN/mm, on flat ground.

    As printed in Table 9 where it has the case. The cases that the source could not process get their printed value
    at 0 km/h times the ratio by which the printed stiffness falls from 0 km/h to their speed, averaged over the
    unloading cases that Table 9 has at both.

    Raises
    ------
    BadInput
        If Table 9 has neither the case nor the same load and step at 0 km/h, or nothing at the speed.
    """
    printed = _printed()
    if case in printed:
        return printed[case]
    ratios = [
        k / printed[standing]
        for other, k in printed.items()
        if (other.configuration, other.speed_km_h) == (case.configuration, case.speed_km_h)
        and (standing := other._replace(speed_km_h=0.0)) in printed
    ]
    standing = case._replace(speed_km_h=0.0)
    if standing not in printed or not ratios:
        raise BadInput(f"{case.label}: Table 9 says nothing of its stiffness; simulate a case of the test plan")
    return printed[standing] * float(np.mean(ratios))


@functools.cache
def _printed() -> dict[Case, float]:
    table = read_table(data_path("published/table_09_stiffness.csv"))
    rows = table[[*CASE_FACTORS, "k_kN_per_mm"]].itertuples(index=False)
    return {Case(name, direction, *map(float, numbers)): float(k) for name, direction, *numbers, k in rows}
