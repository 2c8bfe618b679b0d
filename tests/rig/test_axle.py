"""Rigs read from TOML, and what is refused."""

import pytest
from pydantic import ValidationError

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.rig.axle import Accuracy, Rollers, Sensors, Tyre, load_rig
from bayes_tyre.rig.sensors import columns_of, sensors_of


@pytest.fixture
def single_text() -> str:
    return data_path("rigs/single.toml").read_text()


def test_embedded_rigs_hold_the_published_lengths():
    single, dual = load_rig("single"), load_rig("dual")
    assert (single.axle.support_to_wheel_centre_mm, dual.axle.support_to_wheel_centre_mm) == (1300, 1290)
    assert (single.axle.support_to_measurement_mm, dual.axle.support_to_measurement_mm) == (950, 885)
    assert (single.tyre, dual.tyre) == (Tyre(unloaded_radius_mm=536.0), Tyre(unloaded_radius_mm=537.75))
    assert (single.axle.axle_load_kN, dual.axle.axle_load_kN) == (2.518, 2.718)
    assert single.channels.acceleration == "Acc m/s^2"


def test_a_rig_of_ones_own_and_its_defaults(tmp_path, single_text):
    own = tmp_path / "own.toml"
    own.write_text(single_text[: single_text.index("[channels]")].replace('name = "single"', 'name = "mine"'))
    rig = load_rig(own)
    assert rig.name == "mine"
    assert rig.channels == load_rig("single").channels
    assert rig.signs.load_positive_into_rollers
    assert (rig.sensors.displacement_delay_ms, rig.sensors.displacement_delay_sd_ms) == (0, 2)
    assert load_rig(str(own)) == rig
    own.write_text(f"{single_text}\n[sensors]\ndisplacement_delay_ms = 1.5\nload_delay_sd_ms = 0\n")
    assert load_rig(own).sensors == Sensors(displacement_delay_ms=1.5, load_delay_sd_ms=0.0)


def test_lever_arms_without_a_lever_have_no_accuracy(tmp_path):
    own = tmp_path / "own.toml"
    start = (
        'name = "mine"\n[axle]\naxle_load_kN = 0.0\neffective_mass_kg = 120.0\n[accuracy]\nload_relative_sd = 0.01\n'
    )
    own.write_text(start)
    assert load_rig(own).accuracy == Accuracy(load_relative_sd=0.01)
    own.write_text(f"{start}lever_arm_sd_mm = 2.0\n")
    assert "key axle.support_to_wheel_centre_mm: is missing" in refusal(own)


def test_channels_by_number(tmp_path, single_text):
    own = tmp_path / "own.toml"
    start = single_text[: single_text.index("[channels]")]
    own.write_text(f"{start}[channels]\nacceleration = 3\ndisplacement = 12\nload = 13\n")
    rig = load_rig(own)
    assert [sensor.channel for sensor in sensors_of(rig)] == ["column 3", "column 12", "column 13"]
    assert columns_of(rig) == {"time": 1, "column 3": 3, "column 12": 12, "column 13": 13}
    assert rig.model_dump(mode="json")["channels"]["load"] == 13
    own.write_text(f"{start}[channels]\nload = 1\ntime = 2\n")
    assert columns_of(load_rig(own)) == {"time": 2, "column 1": 1}
    assert columns_of(load_rig("single")) is None


def test_whole_numbers_are_numbers(tmp_path, single_text):
    own = tmp_path / "own.toml"
    own.write_text(single_text.replace("radius_mm = 133.5", "radius_mm = 133"))
    assert load_rig(own).rollers == Rollers(radius_mm=133.0, half_spacing_mm=253.0)


ADD, MEND, SPELL = "; add it", "; mend the value", "; mend its spelling or remove it"


@pytest.mark.parametrize(
    ("before", "after", "said", "remedy"),
    [
        ("support_to_load_mm = 875.0\n", "", "axle.support_to_load_mm: is missing", ADD),
        ("[tyre]\nunloaded_radius_mm = 536.0\n", "", "tyre: is missing", ADD),
        ("support_to_load_mm = 875.0", "support_to_load_mm = -875.0", "axle.support_to_load_mm: ", "not -875.0; mend"),
        ("mass_kg = 290.0", "mass_kg = 0", "axle.mass_kg: ", MEND),
        ("mass_kg = 290.0", "mass_kg = inf", "axle.mass_kg: ", MEND),
        ("mass_kg = 290.0", f"mass_kg = 1{'0' * 400}", "axle.mass_kg: ", MEND),
        ("half_spacing_mm = 253.0", 'half_spacing_mm = "253"', "rollers.half_spacing_mm: ", "not '253'; mend"),
        ("half_spacing_mm = 253.0", "half_spacing_mm = 1999-12-31", "rollers.half_spacing_mm: ", MEND),
        ("half_spacing_mm = 253.0", "half_spacing_mm = [253.0]", "rollers.half_spacing_mm: ", "not [253.0]; mend"),
        ("half_spacing_mm = 253.0", "half_spacing_mm = 253.0\nhalf_spacing_m = 0.2", "rollers.half_spacing_m: ", SPELL),
        ("half_spacing_mm = 253.0", 'half_spacing_mm = 253.0\n"a\\nb" = 1', r"rollers.'a\nb': is unknown", SPELL),
        (
            "load_positive_into_rollers = true",
            "load_positive_into_rollers = -1",
            "signs.load_positive_into_rollers",
            MEND,
        ),
        ('load = "Load kN"', 'load = ""', "channels.load: ", MEND),
        (
            'load = "Load kN"',
            "load = 0",
            "channels.load: should be a name, or a column's number from 1 on, not 0",
            MEND,
        ),
        ('load = "Load kN"', "load = true", "channels.load: should be a name, ", MEND),
        ('load = "Load kN"', 'load = "Disp mm "', "channels.load: should be another than that of ", MEND),
        ('load = "Load kN"', "load = 1", "channels.time: should be another than that of channels.load, ", MEND),
        (
            'load = "Load kN"',
            'load = "Load kN"\ntime = 2',
            "channels.time: should stand beside channels given by ",
            MEND,
        ),
        (
            "support_to_load_mm = 875.0",
            "suport_to_load_mm = 875.0",
            "axle.suport_to_load_mm: is unknown; ",
            f"{SPELL} (did you mean axle.support_to_load_mm?)",
        ),
        ("[tyre]", "[tire]", "tire: is unknown; ", f"{SPELL} (did you mean tyre?)"),
        (
            "effective_mass_relative_sd = 0.1",
            "effective_mass_relative_sd = 20",
            "axle.effective_mass_relative_sd: should be a share, not per cent ",
            MEND,
        ),
    ],
)
def test_bad_keys_are_named_as_the_file_spells_them_with_what_to_do(tmp_path, single_text, before, after, said, remedy):
    assert before in single_text
    own = tmp_path / "own.toml"
    own.write_text(single_text.replace(before, after))
    message = refusal(own)
    assert message.startswith(f"{own}: key {said}")
    assert remedy in message
    assert message.endswith("the keys are explained in data/rigs/README.md")


def refusal(name: object) -> str:
    with pytest.raises(BadInput) as caught:
        load_rig(str(name))
    message = str(caught.value)
    assert message.isprintable()
    assert "; " in message
    return message


@pytest.mark.parametrize("name", ["triple", "rigs/none.toml"])
def test_an_unknown_rig_is_refused_with_those_there_are(name):
    assert refusal(name) == f"{name}: no such rig file; name single or dual, or the path of a TOML file"


def test_a_path_that_no_disk_has_is_refused():
    assert "cannot be read: File name too long; name single or dual" in refusal("x" * 300)


def test_a_folder_is_no_rig(tmp_path):
    assert f"{tmp_path}: is a folder, not a rig file; name single or dual" in refusal(tmp_path)


@pytest.mark.parametrize(
    "content",
    [b"name = ", b"[axle]\n[axle]\n", b"\xff\xfe\x00", b"x = " + b"[" * 5000, b"x = " + b"9" * 5000, b"name = 'a\nb'"],
    ids=["half", "twice", "binary", "deep", "long", "two lines"],
)
def test_broken_toml_is_refused(content, tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_bytes(content)
    message = refusal(broken)
    assert message.startswith(f"{broken}: cannot be read as TOML: ")
    assert message.endswith("; mend the file")


def test_an_empty_file_lacks_every_key(tmp_path):
    (tmp_path / "empty.toml").touch()
    assert "key name: is missing (and 1 more); add it" in refusal(tmp_path / "empty.toml")


def test_a_byte_order_mark_is_no_part_of_a_rig(tmp_path, single_text):
    own = tmp_path / "own.toml"
    own.write_text(single_text, encoding="utf-8-sig")
    assert load_rig(own) == load_rig("single")


def test_a_rig_does_not_change():
    with pytest.raises(ValidationError):
        load_rig("single").axle.mass_kg = 1.0
