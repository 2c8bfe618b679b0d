"""The posterior by the compressed likelihood is the one by the direct one, for each kind of noise."""

import pytest
import xarray as xr
from helpers.means_agree import assert_means_agree
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("iterations_fully_compiled")]

SETTINGS = SamplerSettings(chains=2, warmup=350, draws=1000, seed=4, target_accept=0.65)
FOUR_CASES = Plan(("x", "y"), (0.0,), (20.0,), (-5.0, 5.0), repeats=3, points=60)


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_means_agree_within_their_monte_carlo_errors(noise):
    table = check_record_table(simulate(FOUR_CASES, 6)[0])

    def posterior(likelihood: str) -> xr.Dataset:
        model = ModelSettings(likelihood=likelihood, noise=noise)
        return fit_hierarchical(table, SETTINGS, model)["posterior"].to_dataset()

    one, other = posterior("compressed"), posterior("direct")
    assert not one["k"].equals(other["k"])  # rounded otherwise, they went other ways
    assert_means_agree(one, other, least=100)
