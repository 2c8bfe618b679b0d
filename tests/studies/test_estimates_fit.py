"""Calibration of the fits of estimates in a quick form: the right model passes, readings off by 1.5 do not."""

import pytest

from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.studies.calibration import SimulatedFit, calibrate
from bayes_tyre.studies.design import calibration_design
from bayes_tyre.studies.design_fit import Thinned
from bayes_tyre.studies.estimates_fit import MotionsFit, PublishedFit
from bayes_tyre.studies.truths import Planted

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("iterations_fully_compiled")]

SETS, SEED = 12, 0
QUICK = Thinned(SamplerSettings(chains=2, warmup=200, draws=60), thin=3, draws=39)


@pytest.fixture(scope="module", params=["published", "motion"])
def fit(request) -> SimulatedFit:
    return PublishedFit(QUICK) if request.param == "published" else MotionsFit(calibration_design(), QUICK)


def test_the_right_model_is_calibrated(fit):
    found = calibrate(SETS, SEED, fit=fit)
    # As in `test_quick_forms`: a seed of the 95 % of which all parameters together are called calibrated.
    assert found.table["calibrated"].all(), found.table.loc[~found.table["calibrated"]]
    expected = {"k_group", "k_case", "beta_case", "log_likelihood", "log_prior", "log_likelihood_of_record", "k_ratio"}
    expected |= {"x", "m", "settled_case", "log_repeats"} if isinstance(fit, MotionsFit) else {"student_nu"}
    assert expected <= set(found.table["parameter"])
    assert len(found.datasets) == SETS


def test_readings_that_are_off_by_half_as_much_again_are_found(fit):
    found = calibrate(SETS, SEED, fit=fit, planted=Planted(noise=1.5))
    p_values = dict(zip(found.table["parameter"], found.table["p_value"], strict=True))
    # Of motions the readings' errors are known, and their density says it; printed means scatter by what is unknown.
    # Where all is right, a p-value is below 0.01 in 1 % of seeds.
    name = "log_likelihood" if isinstance(fit, MotionsFit) else "sd_log_k_published"
    assert p_values[name] < 0.01
