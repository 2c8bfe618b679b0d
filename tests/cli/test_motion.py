"""`motion`: raw files to a posterior with every table of `fit`; `--law` with another law; `compare` of laws."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import FACTORS, TABLES, assert_refused, here, tree_of
from helpers.quick_motions import put_draws_for_the_motions

from bayes_tyre.report.figures import catalogue
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw import motion_estimates
from bayes_tyre.workflow.raw.simulate import write_simulated

# Fits the motions of two files by three laws, and samples: over 10 s.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled")]

# Of one rig: each further one is compiled for anew.
GOOD = ("DynamicS(0)20-30(1).lvm", "DynamicS(0)30-20(1).lvm")
RIGS = {"single": load_rig("single")}
PARAMETERS = ["k", "x", "beta", "m", "c", "energy_per_cycle"]
UNITS = {"k": "kN/mm", "x": "kN", "beta": "mm", "m": "kg", "c": "kN s/mm", "energy_per_cycle": "J"}
COLUMNS = {
    *("k_kN_per_mm", "k_kN_per_mm_se", "x_kN", "x_kN_se", "beta_mm", "beta_mm_se", "m_kg", "m_kg_se"),
    *("c_kN_s_per_mm", "c_kN_s_per_mm_se", "discrepancy_kN", "discrepancy_percent", "load_departure_percent"),
    *(f"{name}_se_without_force" for name in ("k_kN_per_mm", "x_kN", "beta_mm")),
    *("displacement_delay_ms", "load_delay_ms", "second_mode_Hz", "second_mode_share", "load_ringing_Hz"),
    *("pareto_k", "status", "origin"),
    *("record", *FACTORS),
}
#: Too few draws for a verdict of `pass`, which asks for 100 effective ones a chain.
FEW = ["--chains", 2, "--warmup", 150, "--draws", 100, "--workers", 1, "--target-accept", 0.8]


def draw_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Return a folder of two simulated recordings and one that is no recording."""
    folder = tmp_path_factory.mktemp("raw")
    plan = [r._replace(duration_s=2.5, step_between_s=(1.0, 1.1)) for r in thesis_plan(4000.0) if r.file in GOOD]
    write_simulated(plan, RIGS, 0, folder, lambda done: None)
    (folder / "DynamicS(0)30-20(3).lvm").write_text("no recording at all")
    return folder


@pytest.fixture(scope="module")
def done(raw, tmp_path_factory):
    """Return where the command wrote, and what came of it."""
    out = tmp_path_factory.mktemp("motion") / "out"
    done = here("motion", raw, "--out", out, *FEW, "--amplitude", 2, "--figures", out.parent / "pictures")
    return out, done


def test_everything_that_fit_writes_is_there_and_the_estimates(done):
    out, ended = done
    assert ended.exit_code == 4, ended.stderr
    written = {name for name in tree_of(out) if not name.startswith(".") and not name.endswith("/")}
    own = {"estimates.csv", "rejected.csv", "motions_shown.csv"}
    assert {"posterior.nc", *TABLES, "diagnostics.json", "run.json", *own} <= written
    figures = {"forest_of_cases", "posteriors_by_direction", "energy_per_cycle", "contrasts"}
    figures |= {"motion_worst", "motion_typical"}
    assert {f"figures/{name}.png" for name in figures} <= written
    assert not {"figures/records_with_bands.png", "figures/outlier_probabilities.png"} & written
    shown = pd.read_csv(out / "motions_shown.csv")
    assert set(shown["shown"]) == {"worst", "typical"}
    left = shown.filter(like="left_over_").to_numpy()
    # Some 8000 white residuals: their mean square is 1 with a standard error of 0.016, and each of the six channels'
    # variances is known to some 4 % from its rest: 0.024 together, five times is 0.12.
    assert np.nanmean(left**2) == pytest.approx(1.0, abs=0.12)
    assert {path.name for path in (out.parent / "pictures").iterdir()} == {
        f"{name.removeprefix('Dynamic').removesuffix('.lvm')}.png" for name in GOOD
    }
    assert not (out / ".checkpoint").exists()


def test_estimates_are_near_the_truth_and_the_rejected_have_reasons(done, raw):
    out, _ = done
    estimates, rejected = pd.read_csv(out / "estimates.csv"), pd.read_csv(out / "rejected.csv")
    assert set(estimates) >= COLUMNS
    assert len(estimates) == len(GOOD)
    assert [file.split("/")[-1] for file in rejected["file"]] == ["DynamicS(0)30-20(3).lvm"]
    truth = pd.read_csv(raw / "truth.csv").set_index("record").loc[estimates["record"]]
    for name in ("k_kN_per_mm", "x_kN", "beta_mm", "m_kg", "c_kN_s_per_mm"):
        off = (estimates[name] - truth[name].to_numpy()) / estimates[f"{name}_se"]
        # 10 numbers, near normal, some correlated: one beyond 5 standard errors in 6e-6 of seeds at most.
        assert np.abs(off).max() < 5


def test_tables_hold_the_parameters_of_the_contract(done):
    out, _ = done
    cases, repeats, contrasts, summary = (
        pd.read_csv(out / name) for name in ("cases.csv", "repeats.csv", "contrasts.csv", "summary.csv")
    )
    assert list(dict.fromkeys(cases["parameter"])) == PARAMETERS
    assert dict(zip(cases["parameter"], cases["unit"], strict=True)) == UNITS
    assert set(repeats["parameter"]) == set(PARAMETERS)
    assert set(contrasts["parameter"]) == set(PARAMETERS)
    assert {f"{name}_mean" for name in PARAMETERS} <= set(summary["parameter"])
    assert {"loss_factor_case", "equivalent_damping_case", "separation_case"} <= set(summary["parameter"])
    for table in (cases, repeats, contrasts, summary):
        assert set(table["origin"]) == {"simulated"}
        assert list(table)[-1] == "verdict" or "decided_by" in table
    assert (cases["median"] > 0).all()


def test_the_amplitude_is_stated_and_the_origin_is_kept(done):
    out, _ = done
    run = json.loads((out / "run.json").read_text())
    assert (run["options"]["amplitude_mm"], run["options"]["law"], run["origin"]) == (2.0, "fancher", "simulated")
    assert len(run["inputs"]) == len(GOOD)
    tree = xr.open_datatree(out / "posterior.nc")
    assert tree["posterior"]["energy_per_cycle_case"].attrs["amplitude_mm"] == 2.0
    assert tree["posterior"]["x_case"].attrs["units"] == "kN"
    assert tree.attrs["model"] == "motion"


def test_show_prints_it_beside_the_truth_too(done, raw):
    out, _ = done
    shown = here("show", out)
    assert shown.exit_code == 0, shown.stderr
    for said in ("energy_per_cycle, J", "x, kN", "simulated records: not measured"):
        assert said in shown.stdout
    beside = here("show", out, "--truth", raw / "truth.csv")
    assert beside.exit_code == 0, beside.stderr
    for name in ("k:", "x:", "beta:", "m:", "c:"):
        assert name in beside.stdout


def test_a_finished_run_is_not_done_again(done, raw):
    out, _ = done
    before = {name: content for name, content in tree_of(out).items() if not name.startswith(".")}
    again = here("motion", raw, "--out", out, *FEW, "--amplitude", 2, "--resume")
    assert "this run is finished" in again.stderr
    assert {name: content for name, content in tree_of(out).items() if not name.startswith(".")} == before


def test_other_options_of_the_hierarchy_use_the_estimates_that_are_kept(done, raw, tmp_path, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(done[0], out)
    with monkeypatch.context() as kept:
        kept.setattr(motion_estimates, "_done", lambda _: pytest.fail("estimated again"))
        draw_none(kept)
        other = here("motion", raw, "--out", out, *FEW, "--amplitude", 3, "--force-scale-sd", 0.2, "--resume")
    assert other.exit_code == 4, other.stderr
    assert "option amplitude_mm was 2.0, is 3.0: sampling starts again" in other.stderr
    assert json.loads((out / "run.json").read_text())["options"]["amplitude_mm"] == 3.0
    assert (out / "estimates.csv").read_bytes() == (done[0] / "estimates.csv").read_bytes()
    energies = [pd.read_csv(folder / "cases.csv").query("parameter == 'energy_per_cycle'") for folder in (done[0], out)]
    assert (energies[1]["median"].to_numpy() > energies[0]["median"].to_numpy()).all()
    # The factor on force widens the intervals of what is in proportion to it, and of nothing else: beta is the same.
    tables = [
        pd.read_csv(folder / "cases.csv").assign(width=lambda t: t["upper"] / t["lower"]) for folder in (done[0], out)
    ]
    widths = [table.pivot_table("width", ["configuration", "step_kN"], "parameter") for table in tables]
    assert (widths[1][["k", "m"]] > 1.2 * widths[0][["k", "m"]]).to_numpy().all()
    np.testing.assert_array_equal(widths[1]["beta"], widths[0]["beta"])
    # And their Monte Carlo errors are those of the wider draws.
    errors = [table.pivot_table("mcse_mean", ["configuration", "step_kN"], "parameter") for table in tables]
    assert (errors[1][["k", "m"]] > 1.2 * errors[0][["k", "m"]]).to_numpy().all()
    np.testing.assert_array_equal(errors[1]["beta"], errors[0]["beta"])


@pytest.mark.parametrize(("option", "value"), [("law", "kelvin_voigt"), ("rig", "dual")])
def test_to_resume_with_another_law_or_rig_is_refused_before_the_estimates_are_lost(done, raw, option, value):
    out, _ = done
    before = tree_of(out)
    other = here("motion", raw, "--out", out, *FEW, "--amplitude", 2, "--resume", f"--{option}", value)
    assert_refused(other.exit_code, other.stderr, f"option {option} was", f"is {value}", "give another --out")
    assert tree_of(out) == before


def test_with_no_usable_file_there_are_reasons_alone(raw, tmp_path):
    done = here("motion", raw / "DynamicS(0)30-20(3).lvm", "--out", tmp_path / "out", *FEW)
    file = f"{raw / 'DynamicS(0)30-20(3).lvm'}: "
    assert_refused(done.exit_code, done.stderr, file, "none of 1 files", "rejected.csv")
    assert set(tree_of(tmp_path / "out")) == {"rejected.csv"}


def test_an_unknown_law_is_a_usage_error_that_lists_what_there_is(raw, tmp_path):
    done = here("motion", raw, "--out", tmp_path / "out", "--law", "spring")
    assert done.exit_code == 2
    assert "fancher" in done.stderr
    assert tree_of(tmp_path) == {}


@pytest.mark.parametrize(
    ("options", "said"), [(["--rig", "none.toml"], "no such rig"), (["--cases", "no.csv"], "no such")]
)
def test_options_of_no_use_are_refused_before_the_work(raw, tmp_path, options, said):
    done = here("motion", raw, "--out", tmp_path / "out", *options)
    assert_refused(done.exit_code, done.stderr, said)
    assert tree_of(tmp_path) == {}


@pytest.fixture(scope="module")
def maxwell_slip(raw, tmp_path_factory):
    """Return the result of another law than the one that the files were simulated with."""
    out = tmp_path_factory.mktemp("maxwell_slip")
    with pytest.MonkeyPatch.context() as monkeypatch:
        draw_none(monkeypatch)
        done = here("motion", raw, "--out", out, "--law", "maxwell_slip", *FEW)
    assert done.exit_code == 4, done.stderr
    return out


def test_the_tables_hold_the_laws_own_parameters(maxwell_slip):
    assert {"posterior.nc", *TABLES, "estimates.csv", "run.json"} <= set(tree_of(maxwell_slip))
    cases, estimates = (pd.read_csv(maxwell_slip / name) for name in ("cases.csv", "estimates.csv"))
    assert list(dict.fromkeys(cases["parameter"])) == ["k", "settled", "beta", "m", "c", "energy_per_cycle"]
    assert {"settled_kN", "settled_kN_se", "beta_mm", "log_evidence"} <= set(estimates)
    assert "x_kN" not in estimates
    assert json.loads((maxwell_slip / "run.json").read_text())["options"]["law"] == "maxwell_slip"
    assert xr.open_datatree(maxwell_slip / "posterior.nc").attrs["law"] == "maxwell_slip"
    # The law is not the records': its own check has to say so.
    assert (estimates["status"] != "ok").all()


def test_spring_and_damper_come_with_their_classic_estimate_from_the_free_vibration(raw, tmp_path, monkeypatch):
    draw_none(monkeypatch)
    done = here("motion", raw / GOOD[1], "--out", tmp_path, "--law", "kelvin_voigt", *FEW)
    assert done.exit_code == 4, done.stderr
    row = pd.read_csv(tmp_path / "estimates.csv").iloc[0]
    # On the steep beginnings of the records' branches small swings meet a stiffer spring than the fit's.
    assert 1.0 < row["decay_k_kN_per_mm"] / row["k_kN_per_mm"] < 4.0
    assert 1.0 < row["decay_c_kN_s_per_mm"] / row["c_kN_s_per_mm"] < 10.0


def test_laws_are_ranked_and_that_of_the_simulation_is_first(done, maxwell_slip, tmp_path):
    results = {"fancher": done[0], "maxwell_slip": maxwell_slip}
    # A model is called as its folder is.
    named = [shutil.copytree(out, tmp_path / law) for law, out in results.items()]
    compared = here("compare", *named, "--out", tmp_path / "out", "--no-refit")
    assert compared.exit_code == 4, compared.stderr
    table = pd.read_csv(tmp_path / "out" / "comparison.csv")
    assert list(table["model"]) == ["fancher", "maxwell_slip"]
    worse = table.iloc[1]
    assert worse["elpd_difference"] < -2 * worse["difference_se"]
    assert "fancher predicts a record left out better than maxwell_slip" in compared.stdout
    by_record = pd.read_csv(tmp_path / "out" / "comparison_records.csv")
    evidence = {law: pd.read_csv(out / "estimates.csv")["log_evidence"].to_numpy() for law, out in results.items()}
    differences = by_record[by_record["model"] == "fancher"]["elpd"].to_numpy() - (
        by_record[by_record["model"] == "maxwell_slip"]["elpd"].to_numpy()
    )
    # What other records tell of a record's few parameters is worth tens at most; its readings decide by more.
    np.testing.assert_allclose(differences, evidence["fancher"] - evidence["maxwell_slip"], rtol=0, atol=60.0)


def test_motions_of_other_files_and_fits_are_not_compared(done, raw, tmp_path, monkeypatch):
    put_draws_for_the_motions(monkeypatch)
    draw_none(monkeypatch)
    changed = shutil.copytree(raw, tmp_path / "raw", ignore=shutil.ignore_patterns("*(3).lvm"))
    with (changed / GOOD[0]).open("a") as file:
        file.write("\n")
    for other, said in ((raw / GOOD[0], "do not both have"), (changed, "run motion on one set by each law")):
        made = here("motion", other, "--out", tmp_path / "made", *FEW)
        assert made.exit_code == 0, made.stderr
        refused = here("compare", done[0], tmp_path / "made", "--out", tmp_path / "out")
        assert_refused(refused.exit_code, refused.stderr, "not of the same raw files", said)
        assert not (tmp_path / "out").exists()


def test_an_average_over_laws_has_their_weights_and_says_them(raw, tmp_path, monkeypatch):
    put_draws_for_the_motions(monkeypatch)
    draw_none(monkeypatch)
    done = here("motion", *(raw / name for name in GOOD), "--out", tmp_path / "out", *FEW, "--law", "auto")
    assert done.exit_code == 0, done.stderr
    estimates = pd.read_csv(tmp_path / "out" / "estimates.csv")
    assert estimates["weight_relaxing"].tolist() == [1.0, 1.0]
    assert {f"weight_{name}" for name in ("fancher", "speed_friction", "stiffening", "two_yields")} <= set(estimates)
    limitations = json.loads((tmp_path / "out" / "diagnostics.json").read_text())["limitations"]
    assert any("in the mean of 2 records relaxing 1.00" in one for one in limitations)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["options"]["law"] == "auto"
    laws = pd.read_csv(tmp_path / "out" / "laws.csv")
    assert laws["law"].tolist()[0] == "relaxing"
    np.testing.assert_allclose(laws["weight_by_record"], estimates[[f"weight_{law}" for law in laws["law"]]].mean())

    # The same estimates, not fitted again, weighted by all records.
    monkeypatch.setattr(motion_estimates, "_done", lambda task: pytest.fail("was fitted again"))
    further = ["--out", tmp_path / "out", *FEW, "--law", "auto_campaign", "--resume"]
    pooled = here("motion", *(raw / name for name in GOOD), *further)
    assert pooled.exit_code == 0, pooled.stderr
    assert pd.read_csv(tmp_path / "out" / "laws.csv").equals(laws)
    by_all = pd.read_csv(tmp_path / "out" / "estimates.csv")
    # Each record is ahead by 10, which four other laws share: 2 of weight e^-20 are left to Fancher's.
    np.testing.assert_allclose(by_all["k_kN_per_mm"] / estimates["k_kN_per_mm"], 1.05, rtol=1e-6)
    assert by_all["weight_relaxing"].tolist() == [1.0, 1.0]
    said = "over 2 records"
    assert said in json.loads((tmp_path / "out" / "diagnostics.json").read_text())["limitations"][0]
    assert said in " ".join(pooled.stdout.split())
    other = here("motion", raw / GOOD[0], "--out", tmp_path / "out", *FEW, "--law", "relaxing", "--resume")
    assert_refused(other.exit_code, other.stderr, "option law was auto_campaign, is relaxing")
