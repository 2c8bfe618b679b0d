"""Tables and figures of motions on each law: its own parameters, and nothing of what it does not have."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, quiet

from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.motion.hierarchy.posterior_losses import Middle, with_losses
from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS
from bayes_tyre.inference.sampling.datatree import is_of_motions, to_datatree
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.html import glossary
from bayes_tyre.report.html.between_results import has_cases
from bayes_tyre.results import summary
from bayes_tyre.results.contrasts import contrasts
from bayes_tyre.rig.axle import load_rig

FACTORS = grid(repeats=1, speeds=(0.0,))
TYPICAL = {"k": 1.8, "settled": 0.2, "beta": 0.08, "n": 1.4, "m": 285.0, "c": 0.0015}
TYPICAL |= {"belt_frequency": 60.0, "belt_damping": 0.05, "sidewall_ratio": 4.0}
SHOWN = {
    "kelvin_voigt": ["k", "m", "c", "energy_per_cycle"],
    "bouc_wen": ["k", "settled", "beta", "n", "m", "c", "energy_per_cycle"],
    "maxwell_slip": ["k", "settled", "beta", "m", "c", "energy_per_cycle"],
    "rigid_ring": ["k", "belt_frequency", "belt_damping", "sidewall_ratio", "m", "c", "energy_per_cycle"],
}


def test_every_law_with_parameters_of_its_own_is_tried_here():
    assert set(SHOWN) == {name for name, law in MOTION_LAWS.items() if law.reported != FANCHER.reported}


@pytest.fixture(scope="module", params=sorted(SHOWN))
def tree(request) -> xr.DataTree:
    rng, factors, law = np.random.default_rng(0), find_factors(FACTORS), MOTION_LAWS[request.param]
    draws = {"sd_log_k_repeat": 0.01 * np.exp(0.1 * rng.standard_normal((2, 60)))}
    for ending, units in (("", len(FACTORS)), ("_case", len(factors.cases)), ("_group", len(factors.group.labels))):
        for name in law.parameters:
            draws[f"{name}{ending}"] = TYPICAL[name] * np.exp(0.03 * rng.standard_normal((2, 60, units)))
    attributes = {"model": "motion", "repeats": "normal", "law": law.name, "origin": "simulated"}
    tree = to_datatree(draws, quiet(2, 60), factors, FACTORS, attributes)
    return with_losses(tree, FACTORS, [Middle(load_rig(name), 10.0) for name in FACTORS["configuration"]], 2.0)


def test_tables_have_the_laws_own_parameters(tree):
    law = tree.attrs["law"]
    for table in (summary.cases(tree, "pass"), summary.repeats(tree, "pass"), contrasts(tree, "pass")):
        assert list(dict.fromkeys(table["parameter"])) == SHOWN[law]
    assert set(SHOWN[law]) <= set(glossary.PARAMETERS)
    told = set(summary.summary(tree, "pass")["parameter"])
    assert {f"{name}_mean" for name in SHOWN[law]} <= told
    assert ("separation_case" in told) == MOTION_LAWS[law].has_friction
    assert is_of_motions(tree["posterior"].to_dataset())


def test_energy_is_what_the_law_loses(tree):
    energy = float(tree["posterior"]["energy_per_cycle_case"].mean())
    if not MOTION_LAWS[tree.attrs["law"]].has_friction:
        # pi c omega a^2, omega by k at the wheel centre: between 60 and 110 rad/s for such a tyre and axle. So far
        # below its frequency the ring's own damper adds some hundredths.
        assert np.pi * 0.0015 * 60 * 4 < energy < np.pi * 0.0015 * 110 * 4
    else:
        # Near 4 settled (a - beta) of a settled loop, on rollers that weigh the friction by about 1.
        assert energy == pytest.approx(4 * 0.2 * (2.0 - 0.08), rel=0.2)


def test_every_figure_can_be_drawn(tree):
    assert has_cases(tree)  # so that the report draws them, and sets results side by side
    drawn = dict(catalogue.draw(Result(tree, "pass")))
    assert "energy_per_cycle" in drawn
    # A panel for each parameter that the law has, and none for what it has not.
    for name in ("forest_of_cases", "contrasts"):
        assert sum(ax.get_visible() for ax in drawn[name].axes) == len(SHOWN[tree.attrs["law"]])
