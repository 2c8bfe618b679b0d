"""No curve that Equation 2 does not describe is called ok, however densely it was sampled; those of it are."""

import numpy as np
import pandas as pd
import pytest
from helpers.measured_loops import as_table, made_branch, measured_branches

from bayes_tyre.inference.least_squares.table import fit_records

# Compilation: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

#: Fewest points of a thinned branch that can be fitted and judged at all.
LEAST = 5


def judged(branches: dict[str, pd.DataFrame], every: int) -> pd.DataFrame:
    """Return status, rmse as a part of the change of force, and k in standard errors, a row a branch."""
    table = as_table(branches, every)
    fits = fit_records(table).set_index("record")
    extent = table.groupby("record")["force_kN"].agg(np.ptp)
    return pd.DataFrame(
        {
            "ok": fits["status"] == "ok",
            "status": fits["status"],
            "off": fits["rmse_kN"] / extent,
            "errors": fits["k_kN_per_mm"] / fits["k_kN_per_mm_se"],
        }
    )


@pytest.mark.parametrize("every", [1, 3, 12])
@pytest.mark.parametrize("name", ["steel_slit_damper", "magnetorheological_damper"])
def test_no_measured_branch_that_is_far_off_or_of_negative_stiffness_is_ok(name, every):
    branches = {
        f"{i}": branch for i, branch in enumerate(measured_branches(name)) if len(branch.iloc[::every]) >= LEAST
    }
    if not branches:  # the steel damper's have 10 to 23 points
        assert (name, every) == ("steel_slit_damper", 12)
        return
    found = judged(branches, every)
    assert not (found["ok"] & ((found["off"] > 0.05) | (found["errors"] < -2.0))).any(), found.to_string()


def test_the_damper_that_follows_speed_is_not_called_this_law_s():
    branches = {f"{i}": branch for i, branch in enumerate(measured_branches("magnetorheological_damper"))}
    assert len(branches) > 20
    for every in (1, 3):
        assert not judged(branches, every)["ok"].any()


@pytest.mark.parametrize("law", ["bilinear", "viscous"])
def test_another_law_is_found_at_any_density(law):
    """480 points and what thinning by 5 and 24 leaves; noise of up to 0.5 % of the change of force."""
    branches = {f"{noise} {seed}": made_branch(law, noise, 481, seed) for noise in (0.0, 0.005) for seed in range(5)}
    found = {every: judged(branches, every) for every in (1, 5, 24)}
    assert all((each["off"] > 0.02).all() for each in found.values())
    assert not any(each["ok"].any() for each in found.values())
    # However many points there are, the same is said.
    assert all(each["status"].equals(found[1]["status"]) for each in found.values())


def test_curves_of_equation_2_stay_ok_at_any_density():
    """A record is called wrong by chance with probability 2.5 %, and only where its noise is above 1 % of its force."""
    branches = {
        f"{noise} {seed}": made_branch("equation_2", noise, 481, seed) for noise in (0.0, 0.008) for seed in range(40)
    }
    for every in (1, 5, 12):
        assert judged(branches, every)["ok"].all()


def test_noise_alone_is_not_called_another_curve():
    noisy = {f"{seed}": made_branch("equation_2", 0.04, 40, seed) for seed in range(200)}
    statuses = judged(noisy, 1)["status"]
    # 2.5 % of 200 are 5; 14 or more come up with probability 5e-4.
    assert statuses.str.contains("is not Equation 2").sum() < 14


def test_few_points_far_off_their_curve_are_not_ok():
    """Every fifth point of the magnetorheological damper's branches: 11 to 13 of each."""
    branches = {f"{i}": branch for i, branch in enumerate(measured_branches("magnetorheological_damper"))}
    found = judged(branches, 5)
    assert not found["ok"].any()
    assert (found["status"] == "residuals are large, and too few to tell noise from another curve").sum() > 5
    assert judged({"fine": made_branch("equation_2", 0.001, 11, 0)}, 1)["ok"].all()
