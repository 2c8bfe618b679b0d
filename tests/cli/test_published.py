"""`published`: options that its check alone does not have, and what is refused before anything is written."""

import pytest
from helpers.command_line import assert_refused, here

from bayes_tyre.workflow import published


@pytest.fixture(autouse=True)
def no_work(monkeypatch):
    monkeypatch.setattr(published, "check_published", lambda _: pytest.fail("began to work"))


@pytest.mark.parametrize(
    "option",
    [
        ("--priors", "mine.toml"),
        *((f"--{name}", "8") for name in ("chains", "warmup", "draws")),
        *(("--target-accept", "0.9"), ("--interval", "0.9")),
    ],
)
def test_options_of_the_posterior_are_refused_without_it(option, tmp_path):
    done = here("published", "--out", tmp_path / "never", *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
    assert "no effect without --posterior" in " ".join(done.stderr.split())
    assert not (tmp_path / "never").exists()


def test_priors_and_the_folder_of_the_posterior_are_checked_before_anything_is_written(tmp_path):
    (tmp_path / "priors.toml").write_text("k_grup = { median = 1.8, sd_log = 0.3 }\n")
    done = here("published", "--out", tmp_path / "never", "--posterior", "--priors", tmp_path / "priors.toml")
    assert_refused(done.exit_code, done.stderr, "priors.toml", "k_grup")
    assert not (tmp_path / "never").exists()
    (tmp_path / "posterior").touch()
    done = here("published", "--out", tmp_path, "--posterior")
    assert_refused(done.exit_code, done.stderr, "posterior: is a file")
    assert not (tmp_path / "published_check.csv").exists()
