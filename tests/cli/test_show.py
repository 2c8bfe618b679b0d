"""`show` on a folder that `published --posterior` wrote, whose posterior stands one folder below."""

import shutil

from helpers.command_line import here
from helpers.reported_results import write_made


def test_the_folder_of_published_shows_the_posterior_below_it(tmp_path):
    made = write_made(tmp_path / "published" / "posterior", {"single": 1.5, "dual": 2.0})
    done = here("show", tmp_path / "published")
    assert done.exit_code == 0, done.stderr
    assert done.stdout == here("show", made).stdout
    shutil.rmtree(made)
    assert here("show", tmp_path / "published").exit_code == 3
