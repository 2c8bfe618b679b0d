"""The formulas of the beam against hand values and the textbook."""

import pytest

from bayes_tyre.rig import beam
from bayes_tyre.rig.axle import load_rig


def test_section_of_a_plain_tube():
    plain = beam.beam_of(load_rig("single")).model_copy(
        update={
            "outer_width_mm": 100.0,
            "outer_height_mm": 100.0,
            "inner_width_mm": 80.0,
            "inner_height_mm": 80.0,
            "outer_fillet_mm": 0.0,
            "inner_fillet_mm": 0.0,
        }
    )
    assert beam.section_area_m2(plain) == pytest.approx(3.6e-3)
    assert beam.second_moment_m4(plain) == pytest.approx((0.1**4 - 0.08**4) / 12)


def test_beam_deflection_is_that_of_a_simply_supported_beam():
    rig = load_rig("dual")
    second_moment, modulus, length = 1.142e-5, 200e9, 1.29
    under_load = rig.axle.model_copy(update={"support_to_measurement_mm": rig.axle.support_to_load_mm})
    here = rig.model_copy(update={"axle": under_load})
    a, b = 0.875, 0.415
    textbook = -45e3 * a**2 * b**2 / (3 * modulus * second_moment * length)
    assert beam.beam_deflection_m(here, 45.0, second_moment) == pytest.approx(textbook)


def test_slope_is_the_derivative_of_the_deflection():
    rig = load_rig("single")

    def moved(by_mm: float) -> float:
        at = rig.axle.support_to_measurement_mm - by_mm
        here = rig.model_copy(update={"axle": rig.axle.model_copy(update={"support_to_measurement_mm": at})})
        return beam.beam_deflection_m(here, 45.0, 1.3e-5)

    assert beam.beam_slope_rad(rig, 45.0, 1.3e-5) == pytest.approx((moved(0.1) - moved(-0.1)) / 0.2e-3, rel=1e-6)
