"""Rigs read from TOML, what is refused, and the section formulas against hand values."""

import pytest
from pydantic import ValidationError

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.rig import axle
from bayes_tyre.rig.axle import load_rig


@pytest.fixture
def single_text() -> str:
    return data_path("rigs/single.toml").read_text()


def test_embedded_rigs_hold_the_published_lengths():
    single, dual = load_rig("single"), load_rig("dual")
    assert (single.axle.support_to_wheel_centre_mm, dual.axle.support_to_wheel_centre_mm) == (1300, 1290)
    assert (single.axle.support_to_measurement_mm, dual.axle.support_to_measurement_mm) == (950, 885)
    assert (single.tyre.unloaded_radius_mm, dual.tyre.unloaded_radius_mm) == (536.0, 537.75)
    assert (single.axle.axle_load_kN, dual.axle.axle_load_kN) == (2.518, 2.718)
    assert single.channels.acceleration == "Acc m/s^2"


def test_a_rig_of_ones_own_and_its_defaults(tmp_path, single_text):
    own = tmp_path / "own.toml"
    own.write_text(single_text[: single_text.index("[channels]")].replace('name = "single"', 'name = "mine"'))
    rig = load_rig(own)
    assert rig.name == "mine"
    assert rig.channels == load_rig("single").channels
    assert rig.signs.load_positive_into_rollers
    assert load_rig(str(own)) == rig


def test_whole_numbers_are_numbers(tmp_path, single_text):
    own = tmp_path / "own.toml"
    own.write_text(single_text.replace("radius_mm = 133.5", "radius_mm = 133"))
    assert load_rig(own).rollers.radius_mm == 133.0


@pytest.mark.parametrize(
    ("before", "after", "key"),
    [
        ("support_to_load_mm = 875.0\n", "", "axle.support_to_load_mm"),
        ("support_to_load_mm = 875.0", "support_to_load_mm = -875.0", "axle.support_to_load_mm"),
        ("mass_kg = 290.0", "mass_kg = 0", "axle.mass_kg"),
        ("mass_kg = 290.0", "mass_kg = inf", "axle.mass_kg"),
        ("half_spacing_mm = 253.0", 'half_spacing_mm = "253"', "rollers.half_spacing_mm"),
        ("half_spacing_mm = 253.0", "half_spacing_m = 0.253", "rollers.half_spacing_m"),
        ("[tyre]\nunloaded_radius_mm = 536.0\n", "", "tyre"),
        ("load_positive_into_rollers = true", "load_positive_into_rollers = -1", "signs.load_positive_into_rollers"),
        ('load = "Load kN"', 'load = ""', "channels.load"),
    ],
)
def test_bad_keys_are_named_with_the_file(tmp_path, single_text, before, after, key):
    assert before in single_text
    own = tmp_path / "own.toml"
    own.write_text(single_text.replace(before, after))
    with pytest.raises(BadInput) as caught:
        load_rig(own)
    message = str(caught.value)
    assert str(own) in message
    assert f"key {key}" in message
    assert "\n" not in message


def test_missing_file_folder_and_broken_toml(tmp_path):
    with pytest.raises(BadInput, match="no such rig file"):
        load_rig(tmp_path / "none.toml")
    with pytest.raises(BadInput, match="no such rig file"):
        load_rig(tmp_path)
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ")
    with pytest.raises(BadInput, match="cannot be read as TOML"):
        load_rig(broken)


def test_a_rig_does_not_change():
    with pytest.raises(ValidationError):
        load_rig("single").axle.mass_kg = 1.0


def test_section_of_a_plain_tube():
    plain = load_rig("single").beam.model_copy(
        update={
            "outer_width_mm": 100.0,
            "outer_height_mm": 100.0,
            "inner_width_mm": 80.0,
            "inner_height_mm": 80.0,
            "outer_fillet_mm": 0.0,
            "inner_fillet_mm": 0.0,
        }
    )
    assert axle.section_area_m2(plain) == pytest.approx(3.6e-3)
    assert axle.second_moment_m4(plain) == pytest.approx((0.1**4 - 0.08**4) / 12)


def test_beam_deflection_is_that_of_a_simply_supported_beam():
    rig = load_rig("dual")
    second_moment, modulus, length = 1.142e-5, 200e9, 1.29
    under_load = rig.axle.model_copy(update={"support_to_measurement_mm": rig.axle.support_to_load_mm})
    here = rig.model_copy(update={"axle": under_load})
    a, b = 0.875, 0.415
    textbook = -45e3 * a**2 * b**2 / (3 * modulus * second_moment * length)
    assert axle.beam_deflection_m(here, 45.0, second_moment) == pytest.approx(textbook)


def test_slope_is_the_derivative_of_the_deflection():
    rig = load_rig("single")

    def moved(by_mm: float) -> float:
        at = rig.axle.support_to_measurement_mm - by_mm
        here = rig.model_copy(update={"axle": rig.axle.model_copy(update={"support_to_measurement_mm": at})})
        return axle.beam_deflection_m(here, 45.0, 1.3e-5)

    assert axle.beam_slope_rad(rig, 45.0, 1.3e-5) == pytest.approx((moved(0.1) - moved(-0.1)) / 0.2e-3, rel=1e-6)
