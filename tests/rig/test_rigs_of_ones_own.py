"""Machines without rollers, lever, beam or calibration: short files, and nothing half described."""

import numpy as np
import pytest
from helpers.readme_rigs import readme_rig, readme_texts
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.rig import axle, beam, geometry
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.rig.sensors import sensors_of

SINGLE = data_path("rigs/single.toml").read_text()
ON_ROLLERS = """
name = "direct on rollers"
[axle]
axle_load_kN = 0
effective_mass_kg = 100
[tyre]
unloaded_radius_mm = 500
[rollers]
radius_mm = 150
half_spacing_mm = 200
"""


def load(text: str, folder) -> Rig:
    (folder / "own.toml").write_text(text)
    return load_rig(folder / "own.toml")


@pytest.fixture(scope="module")
def rigs(tmp_path_factory) -> dict[str, Rig]:
    mixed = load(ON_ROLLERS, tmp_path_factory.mktemp("rig"))
    return {name: readme_rig(name) for name in readme_texts()} | {mixed.name: mixed} | {"single": load_rig("single")}


def test_the_examples_of_the_readme_load_and_say_that_they_are_fictional(tmp_path):
    assert set(readme_texts()) == {"flat_ground", "direct_acting"}
    for name, text in readme_texts().items():
        rig = load(text, tmp_path)
        assert rig.name == name
        assert rig.rollers is None
        assert "fictional" in rig.description
        assert len(text.splitlines()) < 25
    assert readme_rig("direct_acting").axle.effective_mass_relative_sd == 0.1


def test_on_flat_ground_the_wheel_centre_is_the_flat_ground(rigs):
    rig = rigs["flat_ground"]
    d = np.linspace(0.0, 30.0, 7)
    np.testing.assert_array_equal(geometry.flat_ground_displacement(rig, d), d)
    np.testing.assert_array_equal(geometry.flat_ground_force(rig, 2 * d, d), 2 * d)
    assert (geometry.curvature_factor(rig), float(geometry.sin_theta(rig, 3.0))) == (1.0, 1.0)
    assert float(geometry.tyre_load(rig, 30.0)) == pytest.approx(30.0 * 800 / 1200 + 2.0)
    assert float(geometry.wheel_centre_displacement(rig, 1.0)) == pytest.approx(1.2)
    with pytest.raises(BadInput, match="key rollers: is missing"):
        geometry.centre_height_mm(rig)


def test_without_a_lever_actuator_and_sensors_act_at_the_wheel_centre(rigs):
    for name in ("direct_acting", "direct on rollers"):
        values = np.array([0.0, 1.0, 30.0])
        np.testing.assert_array_equal(geometry.tyre_load(rigs[name], values), values)
        np.testing.assert_array_equal(geometry.wheel_centre_displacement(rigs[name], values), values)
    assert geometry.curvature_factor(rigs["direct on rollers"]) == pytest.approx(2 * (150 / 650) ** (1 / 3))


@settings(max_examples=60)
@given(
    st.sampled_from(["flat_ground", "direct_acting", "direct on rollers", "single"]),
    st.floats(0.0, 45.0),
    st.floats(0.5, 3.0),
)
def test_from_flat_ground_to_the_actuator_and_back_it_is_the_same_to_1e_10(rigs, name, actuator_kN, k):
    """Eq. 3 to 10 turned round, in numbers of this test, and forward through the package."""
    rig = rigs[name]
    d_f, F_f = geometry.flat_ground_start(rig, actuator_kN, k)
    assert abs(F_f - k * d_f) < 1e-10
    # The displacement at the wheel centre by bisection on Eq. 7, the actuator's load from Eq. 8 turned round.
    low, high = 0.0, 100.0
    for _ in range(200):
        middle = (low + high) / 2
        below = float(geometry.flat_ground_displacement(rig, middle)) < d_f
        low, high = (middle, high) if below else (low, middle)
    factor = float(geometry.curvature_factor(rig) * geometry.sin_theta(rig, low))
    back = (F_f * factor - rig.axle.axle_load_kN) / float(geometry.wheel_centre_force(rig, 1.0))
    assert back == pytest.approx(actuator_kN, rel=1e-10, abs=1e-10)
    assert low == pytest.approx(geometry.wheel_centre_start(rig, actuator_kN, k), rel=1e-10, abs=1e-10)
    measured = low / float(geometry.wheel_centre_displacement(rig, 1.0))
    forward = geometry.flat_ground_displacement(rig, geometry.wheel_centre_displacement(rig, measured))
    assert float(forward) == pytest.approx(d_f, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize(
    ("text", "before", "after", "key"),
    [
        (ON_ROLLERS, "half_spacing_mm = 200", "", "rollers.half_spacing_mm: is missing"),
        (ON_ROLLERS, "[tyre]\nunloaded_radius_mm = 500", "", "tyre: is missing"),
        (ON_ROLLERS, "half_spacing_mm = 200", "half_spacing_mm = 650", "rollers.half_spacing_mm: should be below"),
        (
            ON_ROLLERS,
            "[tyre]",
            "support_to_load_mm = 2.0\n[tyre]",
            "axle.support_to_wheel_centre_mm: is missing (and 1",
        ),
        (SINGLE, "support_to_measurement_mm = 950.0\n", "", "axle.support_to_measurement_mm: is missing"),
        (SINGLE, "mass_kg = 290.0\n", "", "axle.mass_kg: is missing"),
        (SINGLE, "outer_width_mm = 118.7\n", "", "beam.outer_width_mm: is missing"),
        (SINGLE, "load_intercept_kN = 55.1127\n", "", "calibration.load_intercept_kN: is missing"),
        (readme_texts()["direct_acting"], "effective_mass_kg = 120.0", "", "axle.effective_mass_kg: is missing"),
    ],
)
def test_what_is_half_described_is_refused_with_file_and_key(text, before, after, key, tmp_path):
    assert before in text
    with pytest.raises(BadInput) as caught:
        load(text.replace(before, after, 1), tmp_path)
    assert str(caught.value).startswith(f"{tmp_path / 'own.toml'}: key {key}")


def test_a_beam_needs_a_lever(tmp_path):
    lines = [line for line in SINGLE.splitlines() if not line.startswith("support_to")]
    with pytest.raises(BadInput, match=r"key axle\.support_to_wheel_centre_mm: is missing \(and 2 more\)"):
        load("\n".join(lines), tmp_path)


def test_the_formulas_of_the_beam_say_what_they_miss(rigs):
    with pytest.raises(BadInput, match=r"rig 'flat_ground', key beam: is missing; add it"):
        beam.beam_weight_N(rigs["flat_ground"])


def test_sensors_know_their_keys_and_those_without_a_line_have_none(rigs):
    keys = [key for sensor in sensors_of(rigs["single"]) for key in sensor.calibration_keys()]
    assert keys == list(axle.Calibration.model_fields)
    lines = [sensor.line for sensor in sensors_of(rigs["direct_acting"])]
    assert lines == [None, None, (10.0, 0.0)]
    assert [sensor.channel for sensor in sensors_of(rigs["direct_acting"])] == ["Acc m/s^2", "Stroke mm", "Load kN"]
