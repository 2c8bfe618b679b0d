# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 7. Which test should be run next?
#
# A campaign costs days on a rig. Which of its tests distinguished single from dual, and how few would have been enough?
# `bayes-tyre next` forecasts from a fit how wide the 95 % interval of a number will be after tests that have not been
# run; here the same functions are called from Python.
#
# **All records here are reconstructed from the published tables, not measured:** their repeats are assumed. The
# numbers show how one plans, not what the source's rig would have needed.
#
# The goal is `k dual / single`: the ratio of the stiffness of dual and single tyres, averaged over the 24 cases that
# both have. A width of 5 % is the whole interval over the median, about ±2.5 %.

# %%
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

import bayes_tyre as bt
from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.inference.sampling.datatree import tree_cases
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure
from bayes_tyre.report.figures.tests_to_run import width_against_tests
from bayes_tyre.results.next_tests.candidates import candidates, new_cases
from bayes_tyre.results.next_tests.forecast import Forecast, forecast
from bayes_tyre.results.next_tests.goals import parse_goal

# %%
from bayes_tyre.results.next_tests.plan import Costs, choose_tests, planned
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.execution.batch import Machines
from bayes_tyre.workflow.from_results.next import write_next
from bayes_tyre.workflow.raw.motion import estimate_files, fit_estimates
from bayes_tyre.workflow.raw.motion_plan import MotionPlan
from bayes_tyre.workflow.raw.simulate import write_simulated

# %% [markdown]
# ## How precise is the ratio after two repeats of each case, and after all three?
#
# *Reconstructed, not measured.* Two fits: of the first two repeats of all 48 cases, and of the whole campaign. Both
# have two chains, to be quick.

# %%
GOAL, ALIKE = "k dual / single", Costs(minutes_per_test=1.0)


def forecast_of(posterior: xr.DataTree) -> Forecast:
    posterior = put_together(posterior)
    cases = tree_cases(posterior["posterior"].to_dataset())
    possible = candidates(posterior, new_cases(cases, {}))
    return forecast(possible, parse_goal(GOAL, possible.cases, len(cases), possible.parameters))


# %%
records = bt.reconstruct_campaign().records
two_chains = bt.SamplerSettings(chains=2, warmup=600, draws=2000)
fits = {"two repeats": bt.fit(records[records["repeat"] < 3], two_chains), "all": bt.fit(records, two_chains)}
two, whole = map(forecast_of, fits.values())
for name, known in (("two repeats", two), ("all", whole)):
    verdict, doubt = fits[name].attrs["verdict"], "yes" if known.doubtful else "no"
    print(f"reconstructed, {name}: {GOAL} {known.median:.3f}, interval {known.width():.1%} wide", end="; ")
    print(f"verdict {verdict}; far from normal: {doubt}")

# %% [markdown]
# ## Which of the third repeats narrowed the interval most?
#
# *Reconstructed, not measured.* By the fit of two repeats: the width that is expected after one more repeat of a case,
# averaged over the cases of a direction and speed. No single test tells single from dual: the ratio averages 24 pairs
# of cases, and one repeat more of any case narrows the interval by less than a hundredth.

# %%
after = [two.width(variance) for variance in two.variance_after_each()]
table = pd.DataFrame(two.cases[: two.with_records]).assign(width=100 * np.array(after[: two.with_records]))
by_kind = table.groupby(["direction", "speed_km_h"])["width"].agg(["count", "mean", "min"])
by_kind.columns = ["cases", "mean width after one more repeat, %", "narrowest, %"]
print(f"reconstructed; width now {two.width():.3%}")
by_kind.round(3)

# %% [markdown]
# ## Would fewer tests have been enough for what the third repeats brought?
#
# *Reconstructed, not measured.* The plan chooses its tests instead of repeating every case; it saves little, for every
# case counts alike in the ratio.
#
# The fit of all records is more precise than the forecast said. With two repeats that differ nobody can say which of
# them is discordant, so the first fit has no discordant repeats and takes their distance for usual scatter; from three
# repeats on the model tells them apart. A forecast cannot know that: have three repeats of each case before it counts.

# %%
third = list(range(two.with_records))
width_of_third = two.width(two.variance_after(third))
plan = choose_tests(two, width_of_third, 60, ALIKE)
print(f"reconstructed: 48 third repeats, forecast {width_of_third:.2%}, fit of all records {whole.width():.2%}")
print(f"reconstructed: {len(plan)} chosen tests are expected to do the same")
NotebookFigure(
    width_against_tests(planned(two, plan, ALIKE), two.width(), width_of_third, GOAL, Setting("reconstructed"))
)

# %% [markdown]
# ## How many more would 5 % and 2 % take?
#
# *Reconstructed, not measured.* From the fit of the whole campaign, which itself does not reach 5 %: no part of it
# would have been enough.

# %%
for precision in (0.05, 0.02):
    plan = choose_tests(whole, precision, 100, ALIKE)
    width = whole.width(whole.variance_after(plan))
    reach = "reach" if width <= precision else "do not reach"
    print(f"reconstructed: {len(plan)} further tests {reach} {precision:.0%}: {whole.width():.2%} to {width:.2%}")

# %% [markdown]
# ## What should a lab measure to know the energy?
#
# *Simulated, not measured.* No record of displacement and force tells how much energy a cycle loses: that takes the
# axle's motion, and the source's raw signals are not published. Twelve standing recordings are simulated instead, three
# repeats of single and dual from 20 to 30 kN and back, and `motion` fits them.

# %%
standing = {f"Dynamic{tyre}(0){span}({i}).lvm" for tyre in "SD" for span in ("20-30", "30-20") for i in (1, 2, 3)}
short = {"duration_s": 2.5, "step_between_s": (1.0, 1.1)}
recordings = [each._replace(**short) for each in thesis_plan(4000.0) if each.file in standing]
write_simulated(recordings, {name: load_rig(name) for name in ("single", "dual")}, 0, Path("raw"), lambda _: None)
print(f"simulated: {len(recordings)} recordings")

# %%
motion = MotionPlan(bt.SamplerSettings(chains=2, warmup=400, draws=1000))
files = sorted(Path("raw").glob("*.lvm"))
estimated = estimate_files(files, motion, Machines(workers=1), Path("motion"), lambda _: None)
found = fit_estimates(estimated, motion, Path("motion"), [])
print(f"simulated: {len(estimated.table)} recordings, verdict {found.verdict}")

# %% [markdown]
# *Simulated, not measured.* The recordings that know the ratio of k within 3 % know that of the energy six times less
# well: what a cycle loses follows from friction, whose repeats scatter more. Of such recordings a lab needs about three
# times as many for 10 %, and more than ten times as many for 5 %. Its four cases tell about alike.

# %%
for goal, precision in (("k", 0.02), ("energy_per_cycle", 0.10), ("energy_per_cycle", 0.05)):
    done = write_next(Path("motion"), f"{goal} dual / single", precision, Path("next"), tests=300, repeats=1)
    now, after = done.forecast.expected(()).value, done.plan["width_expected"].iloc[-1]
    print(f"simulated: {goal} dual / single, {now:.1%} wide; {len(done.plan)} further tests: {after:.1%}")
done.ranked[["configuration", "direction", "kind", "width_now", "width_expected"]].round(4)
