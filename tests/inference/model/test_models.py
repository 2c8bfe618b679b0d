"""The models' densities: those written in numpy alone, and the same in the coordinates that NUTS walks in."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers import density_by_hand
from helpers.repeats_by_hand import case_by_hand
from helpers.simulated_records import Plan, simulate
from jax.flatten_util import ravel_pytree
from jaxtyping import Array
from numpyro import handlers
from numpyro.infer.initialization import init_to_feasible
from numpyro.infer.util import constrain_fn, log_density, potential_energy
from scipy import stats

from bayes_tyre.inference.model.coordinates import sites as sites_of_coordinates
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, laplace_approximation
from bayes_tyre.inference.model.coordinates.sites import published_in_coordinates, records_in_coordinates
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import by_family, prior_sites, published_sites
from bayes_tyre.inference.model.models import published_model, records_model
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import check_record_table, record_factors

# Each compiles a model, with its Jacobian: some 10 s from cold.
pytestmark = pytest.mark.slow

SEVERAL = Plan(("a",), (0.0, 25.0), (20.0, 30.0), (-5.0, 5.0), points=12, discordant=("a (0)20-25(2)",))
CROSSED = Plan(("a", "b"), (0.0, 25.0), (20.0, 30.0), (-5.0, 5.0), points=12, discordant=("a (0)20-25(2)",))
ONE = Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=12)
FEW = Plan(("a",), (0.0,), (30.0,), (-10.0, -5.0, 5.0, 10.0), points=12)
SEVEN_STEPS = replace(FEW, steps=tuple(way * step for way in (-1.0, 1.0) for step in np.arange(2.5, 20.0, 2.5)))
KINDS = {
    "a remainder of k alone": (FEW, ModelSettings(noise="iid")),
    "a remainder of k alone, of cases that may stand apart": (SEVEN_STEPS, ModelSettings(noise="iid")),
    "mixture": (CROSSED, ModelSettings(noise="iid")),
    "autoregressive": (SEVERAL, ModelSettings(noise="ar1", initial_load="actual")),
    "noise with heavy tails": (SEVERAL, ModelSettings(noise="student")),
    "student": (SEVERAL, ModelSettings(repeats="student", noise="iid")),
    "normal": (SEVERAL, ModelSettings(repeats="normal", likelihood="direct", noise="iid")),
    "one record": (ONE, ModelSettings(noise="ar1")),
    "specimens, days and a pressure": (
        CROSSED,
        ModelSettings(noise="iid", specimen="tyre", day="day", covariates=("pressure_bar", "temperature_C")),
    ),
    "student about specimens": (SEVERAL, ModelSettings(repeats="student", noise="iid", specimen="tyre")),
}
SEEDS = (1, 2, 3)


def test_kinds_whose_cases_may_stand_apart_are_among_them():
    of = {name: find_factors(record_factors(simulate(plan, 1)[0])) for name, (plan, _) in KINDS.items()}
    apart = {name for name, factors in of.items() if density_by_hand.can_stand_apart(factors)}
    assert apart == {
        "mixture",
        "a remainder of k alone, of cases that may stand apart",
        "specimens, days and a pressure",
    }
    assert not of["a remainder of k alone, of cases that may stand apart"].spare_cases("beta")


class Case(NamedTuple):
    """A data set, the model of it, and its coordinates."""

    records: PreparedRecords
    settings: ModelSettings
    approximation: LaplaceApproximation

    @property
    def arguments(self) -> dict[str, Any]:
        return self.records.arguments(self.settings)

    @property
    def repeats(self) -> str:
        return self.settings.repeats if self.records.factors.repeats.max() >= 3 else "normal"

    @property
    def sites(self) -> tuple[str, ...]:
        return prior_sites(self.records.factors, self.settings.repeats, self.settings.noise)

    def by_hand(self, values: dict[str, np.ndarray]) -> float:
        records = self.records
        return density_by_hand.log_density(values, records.data, records.factors, self.repeats, self.settings.noise)


def with_levels(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with what records may share across cases."""
    number, random = table.groupby("record", sort=False).ngroup().to_numpy(), np.random.default_rng(4)
    pressure, temperature = random.uniform(7.0, 9.0, number.max() + 1), random.uniform(10.0, 30.0, number.max() + 1)
    return table.assign(
        tyre=[f"T{n % 3}" for n in number],
        day=[f"day {n % 4}" for n in number],
        pressure_bar=pressure[number],
        temperature_C=temperature[number],
    )


@cache
def made(kind: str) -> Case:
    plan, settings = KINDS[kind]
    # The last record is shorter: padding counts for nothing.
    table = with_levels(check_record_table(simulate(plan, 2)[0].iloc[:-3]))
    records = prepare_records(table, settings)
    approximation = laplace_approximation(records.batch, records.factors, settings.noise)
    return Case(records, settings, approximation)


@cache
def density_of(kind: str) -> Callable[[dict[str, Any]], Array]:
    """Return the log density of a kind's model at values of its sites, compiled once."""
    return jax.jit(lambda values: log_density(records_model, (), made(kind).arguments, values)[0])


def sampled(sites: dict[str, Any]) -> dict[str, Any]:
    return {n: site["value"] for n, site in sites.items() if site["type"] == "sample" and not site["is_observed"]}


def named(values: dict[str, Any], sites: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return sampled values by name, hyperparameters each by its own."""
    found = {name: np.asarray(value) for name, value in values.items()}
    for site, names in by_family(sites, PRIORS).items():
        found |= dict(zip(names, found.pop(site), strict=True))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_the_density_is_that_of_numpy(kind):
    case = made(kind)
    seeded = handlers.seed(records_model, 0)
    at = sampled(handlers.trace(seeded).get_trace(**case.arguments))
    density = density_of(kind)
    for seed in SEEDS:
        # About draws of the prior, near enough to the data for digits to be left.
        near = _near(at, case, seed)
        by_hand = case.by_hand(named(near, case.sites)) + _of_auxiliaries(near)
        assert float(density(near)) == pytest.approx(by_hand, rel=1e-10, abs=1e-8)


def _near(at: dict[str, Any], case: Case, seed: int) -> dict[str, Any]:
    """Return values for all sites: records near their estimates, the others as the priors may have them."""
    random, estimates = np.random.default_rng(seed), case.approximation.records
    near = {name: jnp.asarray(value) for name, value in at.items()}
    for name in near:
        shape = near[name].shape
        if name.startswith("hyperparameters_Beta"):
            near[name] = jnp.asarray(random.uniform(0.02, 0.3, shape))
        elif name.startswith("hyperparameters_"):
            near[name] = jnp.asarray(random.uniform(0.05, 2.0, shape))
        else:
            near[name] = jnp.asarray(random.normal(0.0, 0.5, shape))
    near["log_records"] = estimates.centre[:, 2:] + random.normal(0.0, 0.02, estimates.centre[:, 2:].shape)
    for name in ("log_sigma_typical", "log_sigma_records"):
        if name in near:
            near[name] = jnp.asarray(random.normal(-3.0, 0.3, near[name].shape))
    return near


#: Standard normals by which the model draws what is known in closed form given the rest.
DRAWN = ("choice_z", "kind_z", "case_z", "offsets_z")


def _of_auxiliaries(values: dict[str, Any]) -> float:
    """Return the log density of the standard normals that cases and offsets are drawn by."""
    return float(sum(stats.norm.logpdf(values[name]).sum() for name in DRAWN if name in values))


# Terms of hundreds of levels are each placed alone, those of few together.
@pytest.mark.parametrize(
    ("kind", "most_together"), [*((kind, sites_of_coordinates.MOST_TOGETHER) for kind in KINDS), ("mixture", 0)]
)
def test_the_density_in_coordinates_is_the_same_with_their_volume(kind, most_together, monkeypatch):
    monkeypatch.setattr(sites_of_coordinates, "MOST_TOGETHER", most_together)
    case = made(kind)
    arguments = {"approximation": case.approximation, **case.arguments}
    _assert_change_of_variables(
        partial(records_in_coordinates, **arguments), partial(records_model, **case.arguments), density_of(kind), case
    )


def test_the_density_of_printed_means_is_that_of_numpy_and_in_coordinates_the_same_with_their_volume():
    table, _ = simulate(CROSSED, 1)
    factors = find_factors(table[list(CASE_FACTORS)].drop_duplicates())
    random = np.random.default_rng(0)
    log_printed = {
        "k": random.normal(0.5, 0.1, len(factors.cases)),
        "beta": random.normal(-2.5, 0.3, len(factors.cases)),
    }
    arguments = {"values": {name: np.exp(values) for name, values in log_printed.items()}, "factors": factors}
    model = partial(published_model, **arguments)
    density = jax.jit(lambda values: log_density(model, (), {}, values)[0])
    at = sampled(handlers.trace(handlers.seed(model, 0)).get_trace())
    for seed in SEEDS:
        near = {name: jnp.asarray(np.random.default_rng(seed).uniform(0.1, 1.0, v.shape)) for name, v in at.items()}
        values = named(near, published_sites(factors))
        by_hand = density_by_hand.log_density_of_print(values, np.stack(list(log_printed.values())), factors)
        assert float(density(near)) == pytest.approx(by_hand, rel=1e-10, abs=1e-8)
    _assert_change_of_variables(partial(published_in_coordinates, **arguments), model, density)


def _assert_change_of_variables(
    in_coordinates: Any, model: Any, density: Callable[[dict[str, Any]], Array], case: Case | None = None
) -> None:
    """Compare minus the potential energy with the model's density at the same values plus the map's log volume."""
    start = handlers.substitute(handlers.seed(in_coordinates, 0), substitute_fn=init_to_feasible())
    shapes = {name: np.shape(value) for name, value in sampled(handlers.trace(start).get_trace()).items()}
    sites = sampled(handlers.trace(handlers.seed(model, 0)).get_trace())
    drawn = {name: jnp.zeros_like(value) for name, value in sites.items() if name in DRAWN}
    wanted = set(sites) - set(drawn) | {"log_records_auxiliary"}

    def modelled(at: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in at.items() if name in sites}

    def values(z: dict[str, Any]) -> dict[str, Any]:
        every = constrain_fn(in_coordinates, (), {}, z, return_deterministic=True)
        return {name: value for name, value in every.items() if name in wanted}

    flat, restore = ravel_pytree({name: jnp.zeros(shape) for name, shape in shapes.items()})
    energy = jax.jit(jax.value_and_grad(lambda z: potential_energy(in_coordinates, (), {}, restore(z))))
    forward = jax.jit(lambda z: values(restore(z)))
    to_values = jax.jit(jax.jacfwd(lambda z: ravel_pytree(values(restore(z)))[0]))
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        z = jnp.asarray(random.normal(0.0, 0.5, flat.shape))
        jacobian, at, (height, slope) = to_values(z), forward(z), energy(z)
        assert jacobian.shape == (len(z), len(z))
        expected = float(np.linalg.slogdet(jacobian)[1]) + _density_of_auxiliary_cases(at, case)
        expected += float(density({**modelled(at), **drawn})) - _of_auxiliaries(drawn)
        assert -float(height) == pytest.approx(expected, rel=1e-9, abs=1e-8)
        # What NUTS follows: the slope along a random direction, by central differences too.
        along = random.normal(size=len(z))
        ends = [float(energy(z + step * along)[0]) for step in (-1e-5, 1e-5)]
        assert float(slope @ along) == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-5, abs=1e-3)


def _density_of_auxiliary_cases(values: dict[str, Any], case: Case | None) -> float:
    """Return the log density of auxiliary cases given the records and the choice that shapes the coordinates."""
    if "log_records_auxiliary" not in values:
        return 0.0
    assert case is not None
    factors, total = case.records.factors, 0.0
    numbers = density_by_hand.numbers_of(named(values, case.sites), factors)
    cases = case.approximation.cases
    discordant = np.asarray(cases.discordant) & (case.repeats == "mixture")
    apart = np.asarray(cases.apart)
    for row, parameter in enumerate(np.flatnonzero(numbers.remainder[:, 0])):
        for of_case in range(len(factors.cases)):
            mean, sd = case_by_hand(numbers, factors, of_case, discordant, int(parameter), apart[parameter, of_case])
            total += stats.norm.logpdf(values["log_records_auxiliary"][row, of_case], mean, sd)
    return float(total)
