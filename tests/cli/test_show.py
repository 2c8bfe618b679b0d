"""`show`: of a folder whose posterior stands one folder below, and options that are of posteriors."""

import shutil

import pytest
from helpers.command_line import assert_refused, here, small, written
from helpers.reported_results import write_made


def test_the_folder_of_published_shows_the_posterior_below_it(tmp_path):
    made = write_made(tmp_path / "published" / "posterior", {"single": 1.5, "dual": 2.0})
    done = here("show", tmp_path / "published")
    assert done.exit_code == 0, done.stderr
    assert done.stdout == here("show", made).stdout
    shutil.rmtree(made)
    assert here("show", tmp_path / "published").exit_code == 3


@pytest.mark.parametrize("option", [("--limit", "k >= 1.8"), ("--reference", "single")])
def test_options_of_a_posterior_are_refused_where_there_is_none(option, tmp_path):
    made = write_made(tmp_path / "made", {"single": 1.5, "dual": 2.0})
    assert here("lsq", written(small(), tmp_path / "records.csv"), "--out", tmp_path / "lsq").exit_code == 0
    done = here("show", made, tmp_path / "lsq", *option)
    assert_refused(done.exit_code, done.stderr, f"{tmp_path / 'lsq'}: holds no posterior, which {option[0]} is of")
    assert done.stdout == ""
    done = here("show", made, "--truth", tmp_path / "truth.csv", *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr


def test_limits_of_several_results_name_the_folder_of_each(tmp_path):
    folders = [write_made(tmp_path / name, {"single": k}) for name, k in (("one", 1.5), ("other", 2.0))]
    lines = here("show", *folders, "--limit", "k >= 1.8").stdout.splitlines()
    of_limits = [line for line in lines if "is at least 1.8 kN/mm with probability" in line]
    starts = [line.partition(": k of single")[0] for line in of_limits]
    assert list(dict.fromkeys(starts)) == [str(folder) for folder in folders]
    of_one = here("show", folders[0], "--limit", "k >= 1.8").stdout.splitlines()
    assert {line.removeprefix(f"{folders[0]}: ") for line in of_limits} & set(of_one)
