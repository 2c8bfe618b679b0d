"""Priors as data: a family, its parameters, a unit and a reason for each quantity, and how a user's own are read."""

import difflib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import listed

#: The keys of the constants beside the priors, in a mapping or a file: fields of `Priors`.
CONSTANTS = ("discordant_widening", "apart_widening", "apart_weight")


class Family(NamedTuple):
    """A family that a prior may have: its parameters as a user names them, and its distribution in SciPy.

    Attributes
    ----------
    name, distribution:
        As a file names it, and NumPyro's class.
    parameters:
        What a user gives, in NumPyro's order.
    to_numpyro, from_numpyro:
        From these to NumPyro's parameters, and back.
    scipy:
        From NumPyro's parameters to the frozen distribution.
    positive:
        The parameters that must be above 0.
    """

    name: str
    distribution: type[dist.Distribution]
    parameters: tuple[str, ...]
    to_numpyro: Callable[..., tuple[float, ...]]
    from_numpyro: Callable[..., tuple[float, ...]]
    scipy: Callable[..., Any]
    positive: tuple[str, ...]


def _same(*values: float) -> tuple[float, ...]:
    return values


FAMILIES = (
    Family(
        "log_normal",
        dist.LogNormal,
        ("median", "sd_log"),
        lambda median, sd_log: (float(np.log(median)), sd_log),
        lambda location, scale: (float(np.exp(location)), scale),
        lambda location, scale: stats.lognorm(scale, scale=np.exp(location)),
        ("median", "sd_log"),
    ),
    Family(
        *("half_normal", dist.HalfNormal, ("scale",), _same, _same),
        lambda scale: stats.halfnorm(scale=scale),
        ("scale",),
    ),
    Family("beta", dist.Beta, ("a", "b"), _same, _same, stats.beta, ("a", "b")),
    Family("normal", dist.Normal, ("mean", "sd"), _same, _same, stats.norm, ("sd",)),
)
_BY_CLASS = {family.distribution: family for family in FAMILIES}
_BY_NAME = {family.name: family for family in FAMILIES}


class Prior(NamedTuple):
    """One prior.

    Attributes
    ----------
    family:
        The NumPyro distribution; LogNormal takes location and scale of the logarithm.
    parameters:
        Its arguments in order.
    unit:
        Unit of the quantity; empty for a pure number.
    reason:
        What it allows, and why this wide.
    """

    family: type[dist.Distribution]
    parameters: tuple[float, ...]
    unit: str = ""
    reason: str = ""

    def distribution(self) -> dist.Distribution:
        """Return the prior as a NumPyro distribution."""
        return self.family(*self.parameters)

    def scipy(self) -> Any:
        """Return the prior as a frozen distribution of SciPy: with quantiles, and with nothing for JAX to compile."""
        return _BY_CLASS[self.family].scipy(*self.parameters)

    @property
    def of_logarithm(self) -> bool:
        """Whether it is spread on the logarithm of its quantity: zero is then out of its reach."""
        return self.family is dist.LogNormal

    def given(self) -> dict[str, float | str]:
        """Return it as a user gives it, such as ``{"family": "log_normal", "median": 1.8, "sd_log": 0.3}``."""
        family = _BY_CLASS[self.family]
        # So many digits that the number somebody wrote comes back, and no more: a median has been through a logarithm.
        written = (float(f"{value:.12g}") for value in family.from_numpyro(*self.parameters))
        return {"family": family.name, **dict(zip(family.parameters, written, strict=True))}


@dataclass(frozen=True, repr=False)
class Priors(Mapping[str, Prior]):
    """Every prior of the hierarchical models by the name of its quantity, and the constants of their mixtures.

    Attributes
    ----------
    table:
        The priors by name.
    discordant_widening:
        How many times the usual standard deviation of repeats that of discordant ones is; above 1.
    apart_widening, apart_weight:
        How many times the usual standard deviation of cases about their linear predictor that of cases that stand
        apart is, above 1; and the share of these, below 1. A share of 0 makes the remainder of cases normal.
    """

    table: Mapping[str, Prior]
    discordant_widening: float
    apart_widening: float
    apart_weight: float

    def __repr__(self) -> str:
        return f"<{len(self)} priors>"

    def __getitem__(self, name: str) -> Prior:
        return self.table[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.table)

    def __len__(self) -> int:
        return len(self.table)

    def medians(self) -> dict[str, np.ndarray]:
        """Return the median of each prior, by name."""
        return {name: np.asarray(prior.scipy().median()) for name, prior in self.items()}

    def changed(self, changes: Mapping[str, Any]) -> "Priors":
        """Return these priors with some of them replaced.

        Parameters
        ----------
        changes:
            By name: a `Prior`, or a mapping of the family's parameters such as ``{"median": 1.8, "sd_log": 0.3}``, with
            ``family`` where it is another than the default's; each of `CONSTANTS` a number.

        Raises
        ------
        BadInput
            For a name or a parameter that there is not, a value that cannot be, and a family that the quantity cannot
            have; the message names the key.
        """
        table, constants = dict(self.table), self._constants()
        for name, change in changes.items():
            if name in CONSTANTS:
                constants[name] = _constant(name, change)
            elif name not in table:
                names = [*table, *constants]
                near = difflib.get_close_matches(name, names, n=3)
                rest = (
                    f"did you mean {' or '.join(near)}?"
                    if near
                    else f"there are {listed(names, 6)}, in docs/reference/priors.md"
                )
                raise BadInput(f"priors, {name}: there is no such quantity; {rest}")
            else:
                prior = change if isinstance(change, Prior) else _read(name, change, table[name])
                _check_family(name, table[name], prior)
                if prior.given() != table[name].given():  # else the reason stays
                    table[name] = prior
        return Priors(table, **constants)

    def changes_from(self, others: "Priors") -> dict[str, Any]:
        """Return what differs from other priors, as `changed` takes it and JSON and TOML keep it."""
        changes: dict[str, Any] = {
            name: prior.given()
            for name, prior in self.items()
            if (prior.family, prior.parameters) != (others[name].family, others[name].parameters)
        }
        before = others._constants()
        return changes | {name: value for name, value in self._constants().items() if value != before[name]}

    def given(self) -> dict[str, Any]:
        """Return all of them as a user gives them: what `run.json` keeps, and `changed` takes."""
        return {name: prior.given() for name, prior in self.items()} | self._constants()

    def to_json(self) -> str:
        """Return all of them as JSON, for the attributes of a posterior."""
        return json.dumps(self.given())

    def _constants(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in CONSTANTS}


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise BadInput(f"priors, {key}: {value!r} is not a finite number")
    return float(value)


def _constant(key: str, value: object) -> float:
    number = _number(key, value)
    if key == "apart_weight" and not 0.0 <= number < 1.0:
        raise BadInput(f"priors, {key}: {number:g} is no share; give a number from 0 to below 1, such as 0.05")
    if key != "apart_weight" and number <= 1.0:
        raise BadInput(f"priors, {key}: {number:g} does not widen; give a number above 1, such as 6")
    return number


def _read(name: str, change: Any, default: Prior) -> Prior:
    """Return the prior that a mapping of parameters describes."""
    own = _BY_CLASS[default.family]
    if not isinstance(change, Mapping):
        example = ", ".join(f"{key} = {value:.3g}" for key, value in default.given().items() if key != "family")
        raise BadInput(f"priors, {name}: {change!r} is no prior; give its parameters, such as {{ {example} }}")
    family = _BY_NAME.get(str(change.get("family", own.name)))
    if family is None:
        raise BadInput(f"priors, {name}, family: {change['family']!r} is unknown; use {', '.join(_BY_NAME)}")
    wanted = set(family.parameters)
    if wrong := sorted(map(str, wanted ^ (set(change) - {"family", "reason"}))):
        raise BadInput(f"priors, {name}, {wrong[0]}: a {family.name} prior has {' and '.join(family.parameters)}")
    values = {key: _number(f"{name}, {key}", change[key]) for key in family.parameters}
    for key in family.positive:
        if values[key] <= 0:
            raise BadInput(f"priors, {name}, {key}: {values[key]:g} is not above 0")
    return Prior(family.distribution, family.to_numpyro(*values.values()), default.unit, str(change.get("reason", "")))


def _check_family(name: str, default: Prior, prior: Prior) -> None:
    """Refuse a family that the model cannot give this quantity.

    Group means and typical noise are normal on their (transformed) axis, for their coordinates follow the data in
    closed form; other positive quantities may be log-normal or half-normal.
    """
    fixed = name.endswith(("_group", "_typical")) or default.family in (dist.Beta, dist.Normal)
    allowed = (default.family,) if fixed else (dist.LogNormal, dist.HalfNormal)
    if prior.family not in allowed:
        names = " or ".join(_BY_CLASS[each].name for each in allowed)
        raise BadInput(f"priors, {name}, family: must be {names}")
