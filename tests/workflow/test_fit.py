"""What a fit takes from its table, and what `run.json` says of it."""

import json

from helpers.command_line import assert_refused, here, small, written
from helpers.quick_fits import put_a_fit_without_checks_and_figures

from bayes_tyre.workflow import fit as workflow


def test_how_accurate_the_rig_is_counts_and_is_recorded(monkeypatch, tmp_path):
    put_a_fit_without_checks_and_figures(monkeypatch)
    records = written(small().assign(force_scale_sd=0.02, displacement_scale_sd=0.03), tmp_path / "records.csv")
    for options, force, displacement in (((), 0.02, 0.03), (("--force-scale-sd", "0"), None, 0.03)):
        here("fit", records, "--out", tmp_path / "out", *options)
        run = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["options"]
        assert (run.get("force_scale_sd"), run["displacement_scale_sd"]) == (force, displacement)
        again = workflow.planned_in(tmp_path / "out" / "run.json", lambda _: None)  # of --from
        assert (again.model.force_scale_sd, again.model.displacement_scale_sd) == (force or 0.0, displacement)
    bad = written(small().assign(force_scale_sd="good"), tmp_path / "bad.csv")
    done = here("fit", bad, "--out", tmp_path / "bad")
    assert_refused(done.exit_code, done.stderr, str(bad), "column force_scale_sd", "'good'")
