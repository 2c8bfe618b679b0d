"""What a result of motions says of friction and of the energy lost: a sentence, a table, and what it does not say."""

from collections.abc import Sequence

import pandas as pd

from bayes_tyre.record import ENERGY, RING_DOWN_MM
from bayes_tyre.report.answer.formatting import given, interval_name, label, rounded
from bayes_tyre.report.answer.load import Reported

#: What a law predicts of the stiffness of other tests, in `summary.csv`, and what a sentence calls it.
_STIFFNESSES = {
    "static_stiffness_case": "a slow cycle of {asked}",
    "ring_down_stiffness_case": "a free vibration of {small}",
}
#: What a law tells of friction, by the name of its parameter; a law without friction tells none.
FRICTION = {"x": "friction x", "settled": "the settled friction"}
#: Of `summary.csv`: what each case loses beside the energy, how stiff its cycles are, and what the table calls it.
LOSSES = {
    "loss_factor_case": "loss factor",
    "equivalent_damping_case": "equivalent damping",
    "separation_case": "separation of branches",
    "static_stiffness_case": "stiffness of a slow cycle",
    "stiffness_at_1_Hz_case": "stiffness of a cycle at 1 Hz",
    "ring_down_stiffness_case": "stiffness of free vibration",
}
#: With more values than these a sentence leaves their intervals to the table.
_WITH_INTERVAL = 2


def losses_answer(result: Reported) -> str:
    """Return friction and energy lost of each configuration and direction, in one sentence."""
    clauses = {name: f"{called} is" for name, called in FRICTION.items()}
    parts, most = [], 0
    for parameter, clause in {**clauses, ENERGY: f"a cycle of {_amplitude(result)} loses"}.items():
        rows = result.means(parameter)
        if not rows.empty:
            values = ", ".join(_value(row, result, len(rows) <= _WITH_INTERVAL) for _, row in rows.iterrows())
            parts.append(f"{clause} {values}")
            most = max(most, len(rows))
    if not parts:
        return "This result holds no mean friction and no energy lost."
    where = " (medians; their intervals stand in the table below)" if most > _WITH_INTERVAL else ""
    sentence = "; ".join(parts)
    return f"{sentence[0].upper()}{sentence[1:]}{where}."


def _value(row: pd.Series, result: Reported, with_interval: bool) -> str:
    size = f"{interval_name(result.interval)} {rounded(row['lower'])} to {rounded(row['upper'])}"
    reach = f" ({size})" if with_interval else ""
    return f"{rounded(row['median'])} {label(row['unit'])} for {of_group(row)}{reach}"


def of_group(row: pd.Series) -> str:
    """Return what a mean is of, such as ``single in loading``."""
    factors = [label(row[factor]) for factor in ("configuration", "direction") if row[factor]]
    return " in ".join(factors) if factors else "all records"


def amplitude_mm(result: Reported) -> float | None:
    """Return half the stroke of the cycle whose losses a result states, mm; None where it does not say."""
    amplitude = result.run["options"].get("amplitude_mm")
    return float(amplitude) if isinstance(amplitude, int | float) else None


def _amplitude(result: Reported) -> str:
    amplitude = amplitude_mm(result)
    stated = "unknown" if amplitude is None else f"{given(amplitude)}\N{NO-BREAK SPACE}mm"
    return f"{stated} amplitude at the wheel centre"


def _of_other_tests(result: Reported) -> str:
    """Return the stiffness that the fitted law predicts of other tests than steps, over the cases."""
    where = {"asked": _amplitude(result), "small": f"{given(RING_DOWN_MM)}\N{NO-BREAK SPACE}mm"}
    parts = []
    for parameter, test in _STIFFNESSES.items():
        medians = result.summary.loc[result.summary["parameter"] == parameter, "median"]
        if not medians.empty:
            span = " to ".join(dict.fromkeys(rounded(float(value)) for value in (medians.min(), medians.max())))
            parts.append(f"{span} kN/mm for {test.format(**where)}")
    predicts = f"the fitted law predicts {' and '.join(parts)}, by case. " if parts else ""
    return f"{predicts}Set each beside a test of its kind: the law was fitted to steps, and to no slow test."


def losses_caveats(result: Reported) -> list[tuple[str, str]]:
    """Return what not to believe of the losses, and why."""
    by_friction = any(not result.means(parameter).empty for parameter in FRICTION)
    what = (
        "the viscous damping c is not in it"
        if by_friction
        else "its dampers lose all of it, c among them, in a cycle as quick as the mass swings freely on k"
    )
    return [
        (
            "The energy as that of another stroke, or as all that a tyre loses",
            f"it is what the fitted law loses in a cycle of {_amplitude(result)}; {what}.",
        ),
        ("k as the stiffness that a slow test or a free vibration measures", _of_other_tests(result)),
        (
            "The estimates if the tyre does not follow the law that was fitted to its motion",
            "the verdict cannot tell. Look at the residuals: those of a few records below, of each with motion "
            "--figures DIR.",
        ),
    ]


def losses_tables(results: Sequence[Reported]) -> list[pd.DataFrame]:
    """Return the rows of `summary.csv` with what each case loses, the parameters called as a reader reads them."""
    tables = []
    for result in results:
        rows = result.summary[result.summary["parameter"].isin(list(LOSSES))]
        tables.append(rows.assign(parameter=rows["parameter"].map(LOSSES)))
    return tables
