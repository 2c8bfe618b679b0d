"""The short form of `make chaos`: a quick command, disturbed in every way; and that its check can fail."""

import pytest
from helpers.chaos import alike
from helpers.disturbed import (
    COMMANDS,
    assert_as_left_alone,
    clock_set_back,
    input_changed,
    inputs,
    killed,
    left_alone,
    out_of_disk,
)


@pytest.mark.slow
def test_a_disturbed_command_gives_the_bytes_of_a_run_left_alone(tmp_path):
    command, folder = COMMANDS["process"], inputs(tmp_path, ["process"])
    alone = left_alone(command, folder)
    killed(command, folder, 0.8 * alone.seconds)
    clock_set_back(folder)
    assert_as_left_alone(command, folder, alone.files)
    out_of_disk(command, folder, 500, alone)
    assert_as_left_alone(command, folder, alone.files)


@pytest.mark.slow
def test_a_killed_command_that_finds_another_input_takes_nothing_of_the_first(tmp_path):
    command, folder = COMMANDS["process"], inputs(tmp_path, ["process"])
    alone = left_alone(command, folder)
    killed(command, folder, 0.8 * alone.seconds)
    input_changed(command, folder)
    assert_as_left_alone(command, folder, alone.files)


@pytest.mark.slow
def test_runs_at_once_on_one_compilation_cache_give_the_same_bytes(tmp_path):
    alike(inputs(tmp_path, ["lsq"]), "lsq", 2)


def test_half_a_file_is_found(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "least_squares.csv").write_text("record,k_kN_per_mm\nx,1.")
    with pytest.raises(AssertionError, match=r"least_squares\.csv is neither whole nor absent"):
        assert_as_left_alone(COMMANDS["lsq"], tmp_path, {"least_squares.csv": b"record,k_kN_per_mm\nx,1.8\n"})
