"""`published`: options that its check alone has no use for, and what is refused before anything is written."""

import pandas as pd
import pytest
from helpers.command_line import assert_refused, here

from bayes_tyre.workflow import published


@pytest.mark.parametrize("option", [("--priors", "mine.toml"), ("--draws", "8"), ("--interval", "0.9")])
def test_options_of_the_posterior_are_said_to_have_no_effect_without_it(option, tmp_path, monkeypatch):
    table = pd.DataFrame({"quantity": ["k"], "kind": ["recomputed"], "agrees": [True]})
    monkeypatch.setattr(published, "check_published", lambda _: table)
    done = here("published", "--out", tmp_path / "out", *option)
    assert done.exit_code == 0
    assert f"{option[0]} has no effect without --posterior" in " ".join(done.stderr.split())


def test_priors_and_the_folder_of_the_posterior_are_checked_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(published, "check_published", lambda _: pytest.fail("began to work"))
    (tmp_path / "priors.toml").write_text("k_grup = { median = 1.8, sd_log = 0.3 }\n")
    done = here("published", "--out", tmp_path / "never", "--posterior", "--priors", tmp_path / "priors.toml")
    assert_refused(done.exit_code, done.stderr, "priors.toml", "k_grup")
    assert not (tmp_path / "never").exists()
    (tmp_path / "posterior").touch()
    done = here("published", "--out", tmp_path, "--posterior")
    assert_refused(done.exit_code, done.stderr, "posterior: is a file")
    assert not (tmp_path / "published_check.csv").exists()
