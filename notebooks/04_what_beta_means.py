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
# # 4. What does beta mean?
#
# beta (mm) is how far a tyre must move before its force follows the line of its stiffness k (kN/mm). A tyre has one;
# what a table prints is what the *processing* returned. Are the two the same?
#
# Only a record whose truth is known can tell. **All data here are simulated, not measured**: an axle that stands, on a
# tyre of chosen k, friction x (kN) and beta, is moved by a load step, and three methods work on what its sensors read:
#
# - `thesis`: the source's steps. The load is taken for the tyre's force, and both signals are smoothed over 801 samples
#   (80 ms).
# - `inertia`: not smoothed, and mass times acceleration is taken off the load.
# - `motion`: the axle's whole motion, ring-down included, is fitted.
#
# What stands here is what simulation shows. It is no statement of what happened on the rig.

# %%
import textwrap

import pandas as pd
from support.audit_figures import one_record

from bayes_tyre.published.tables import characteristic_deflection
from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure
from bayes_tyre.rig import axle, geometry
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals import factors, inertia, process, thesis
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.studies.audit import grid, methods, overview, sentences, study

# %% [markdown]
# ## What becomes of one record?
#
# *Simulated, not measured.* The tyre unloads from 20 to 10 kN in 36 ms. The grey band is what it did: first its
# friction lets go, over beta, then the force follows k. `inertia` comes near. `thesis` returns another curve: the force
# that moves the axle's mass is in it, and the smoothing, twice as long as the response, has drawn it out.

# %%
prepare_jax()
rig, typical = axle.load_rig("single"), grid.TYPICAL
truth = grid.truth_of(typical, 1, rig, seed=0)
simulated = simulate_record(truth, rig)
named = factors.RecordFactors(truth.plan.record, truth.plan.case, 1)
recording = process.prepare(simulated.raw, rig, named)
processing = {"thesis": thesis.thesis, "inertia": inertia.inertia}
paths = {name: methods.curve(method(recording, rig)) for name, method in processing.items()}

# %%
motion, end = simulated.motion, simulated.motion.displacement_mm.argmin()
d, force = motion.displacement_mm[recording.step.start : end], motion.tyre_force_kN[recording.step.start : end]
flat = geometry.flat_ground_displacement(rig, d), geometry.flat_ground_force(rig, force, d)
tyre = pd.DataFrame(dict(zip(("displacement_mm", "force_kN"), flat, strict=True)))
NotebookFigure(one_record(tyre, paths))

# %% [markdown]
# ## Which truths are tried?
#
# True beta from 0.02 to 0.16 mm with a quick and a slow step, and a typical tyre that rings less or is loaded instead.
# This is a small grid, one record a truth, to be quick; `bayes-tyre audit --out DIR --plan full` runs a large one.

# %%
varied = {"damping_ratio": (0.1,), "step_kN": (10.0,)}
crossed = {"beta_mm": (0.02, 0.08, 0.16), "rise_s": (0.036, 0.09)}
windows = (1, 201, 401, grid.SOURCE_WINDOW, 1601)
found = study.study_audit(grid.Plan(varied, crossed, windows), replicates=1)
print(f"{len(found.records.drop_duplicates(list(typical._fields)))} records, simulated, not measured")

# %% [markdown]
# ## Does the beta that comes back follow the tyre's?
#
# *Simulated, not measured.* On the dashed line it does. Where points lie level, or anywhere, the method's beta says
# little about the tyre's.

# %%
NotebookFigure(audit_figures.beta_returned(found.table, grid.SOURCE_WINDOW))

# %% [markdown]
# ## If not the tyre, what moves the beta of `thesis`?
#
# *Simulated, not measured.* Nothing is changed along a line but the length of the moving mean, which is no property of
# any tyre.

# %%
windows = overview.beta_by_window(found.table, "thesis")
NotebookFigure(audit_figures.beta_window(windows, grid.SOURCE_WINDOW))

# %% [markdown]
# ## And k?
#
# *Simulated, not measured.* By how much each method's k is off, one thing changed at a time. The last panel says why:
# not smoothed (window 1) even `thesis` comes near, and with a window longer than the step it does not.

# %%
changed = ("beta_mm", "rise_s", "damping_ratio", "step_kN", grid.WINDOW)
names = {factor: grid.FACTOR_NAMES[factor] for factor in changed}
bias = overview.bias_by_factor(found.table, "k")
NotebookFigure(audit_figures.k_bias(bias, names, grid.TYPICAL_LEVELS))

# %% [markdown]
# ## How far off is each method, and do its intervals hold the truth?
#
# *Simulated, not measured.* Bias in % over the records (median, least, largest), and how many 95 % intervals hold the
# truth: about 95 % should. Only `motion` returns friction x, and with it the energy lost in a cycle; for the others
# `energy_with_true_x` is the error that the energy would have if x were known.

# %%
told = overview.overview(found.table).set_index(["parameter", "method"]).sort_index()
told["hold the truth"] = [
    f"{round(share * of)} of {of}" if of else "no interval"
    for share, of in zip(told["coverage_95"], told["intervals"], strict=True)
]
told[["bias_median", "bias_low", "bias_high", "hold the truth"]].round(1)

# %% [markdown]
# ## What can the published betas say?
#
# *Simulated, not measured, beside the 48 published betas.* The sentences are made from the table above.

# %%
conclusion = sentences.conclusion(found.table, characteristic_deflection()["beta_mm"].tolist())
for said in conclusion:
    if said.startswith(("beta by", "The published", "Limits")):
        print(textwrap.fill(said, 110), end="\n\n")

# %% [markdown]
# ## What not to believe
#
# - That a real record is as kind to `motion` as these: the simulated tyre follows the very law that it fits, and the
#   load's step has a shape that it allows.
# - That every k of the source is off by what `thesis` is here: how much depends on the damping and the step of the rig,
#   which nobody recorded.
# - A share of intervals among so few records to the per cent: `bayes-tyre audit` has more of them.
