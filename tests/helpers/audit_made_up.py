"""An audit whose answers are put there by a rule instead of simulated and fitted."""

from collections.abc import Callable

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.studies.audit.grid import CONFIGURATION, Plan, Tyre
from bayes_tyre.studies.audit.methods import ESTIMATED, MethodEstimate, true_value
from bayes_tyre.studies.audit.study import Audit, summarise, tidy

SMALL = Plan(
    {"k_kN_per_mm": (1.8, 2.2), "damping_ratio": (0.03, 0.1)},
    {"beta_mm": (0.04, 0.12), "rise_s": (0.036, 0.06)},
    (1, 801),
)
RIG = load_rig(CONFIGURATION)
#: What is returned over the truth: of method, parameter, point, window, replicate; None declines the record.
Rule = Callable[[str, str, Tyre, int | None, int], float | None]


def blind(method: str, parameter: str, tyre: Tyre, window: int | None, _: int) -> float:
    """`thesis` returns a beta of its window and the rise time alone; the others return the truth, 2 % off."""
    if method == "thesis" and parameter == "beta":
        return 0.02 * (tyre.rise_s / 0.036) * (3.0 if window == 1 else 1.0) / tyre.beta_mm
    return 1.02


def right(*_: object) -> float:
    """Every method returns the truth, 2 % off."""
    return 1.02


def audited(rule: Rule, replicates: int = 2, half_width: float = 0.05, plan: Plan = SMALL) -> Audit:
    """Return an audit by a rule, each interval the value times 1 less and more a half-width."""
    told = [
        (tyre, n, window, method, _answer(rule, half_width, tyre, n, window, method))
        for tyre in plan.tyres()
        for n in range(1, replicates + 1)
        for method in ESTIMATED
        for window in (plan.windows_of(tyre) if method == "thesis" else (None,))
    ]
    records = tidy(told, RIG)
    return Audit(summarise(records), records)


def _answer(rule: Rule, half_width: float, tyre: Tyre, n: int, window: int | None, method: str) -> MethodEstimate:
    values = {}
    for parameter in ESTIMATED[method]:
        share = rule(method, parameter, tyre, window, n)
        if share is None:
            return MethodEstimate({}, "declined")
        value = share * true_value(parameter, tyre, RIG)
        values[parameter] = (value, value * (1 - half_width), value * (1 + half_width))
    return MethodEstimate(values, "ok")
