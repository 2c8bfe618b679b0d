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
# # 2. Single or dual: which is stiffer, by how much, how sure?
#
# **Dual is stiffer: by 30 %, averaged over the same tests (published numbers; ratio of k 1.30, 95 % interval 1.25 to
# 1.35).** The first figure shows both: in k the curves of single and dual lie apart, in beta they overlap.
#
# Two kinds of data stand here, and only the first is real:
#
# - **Published:** the 48 printed values of k and of beta (Tables 9 and 11 of the source), one a case, no repeats.
# - **Reconstructed, not measured:** 144 records made from these values. Repeats, paths and noise are assumed. Their
#   posterior says what such records *would* support.
#
# Single: one 385/65 R22.5 tyre. Dual: two 315/80 R22.5 tyres side by side. k in kN/mm, beta in mm.

# %%
import pandas as pd
from support import average_contrast_figures, level_figures, results
from support.level_means import level_means

import bayes_tyre as bt
from bayes_tyre.published import tables
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure

pd.set_option("display.max_columns", 20)

# %%
published = bt.fit_published()
checked = bt.diagnose(published)
print(f"published tables: {checked.chains} chains of {checked.draws} draws; verdict: {checked.verdict}")
for sentence in (*checked.reasons, *checked.limitations):
    print(in_words(sentence))

# %% [markdown]
# ## How stiff are single and dual, loading and unloading?
#
# *Published numbers.* Each curve is the mean over the cases of a direction. Where the curves of two configurations do
# not overlap, the data tell them apart. Loading was measured at standstill only, unloading at four speeds: do not
# compare the left panels with the right ones (see the ratios below).
#
# A curve is a *posterior*: what the data leave open, the range of k and beta that they still allow, with how plausible
# each value is. The bar below it is the *95 % interval*, which holds the value with probability 0.95, if model and
# data are right. *P(ratio > 1)* in the tables further down is the probability that the first is larger than the second.

# %%
bt.figure(published, "posteriors_by_direction")

# %% [markdown]
# ## What changes with speed, load and step?
#
# *Published numbers.* Each panel averages the same cases at every level: by speed, unloading from 20 and 30 kN; by
# load, standing tests; by step, all that have both steps. Compare within a panel, not between panels.
#
# The diamonds are means of the printed values themselves. Where one lies off its line, the model takes part of it for
# scatter: it lets speed, load and step act alike on both configurations, and has one printed value a case to go by.
# Of beta at 35 km/h it says: one large printed value is no proof.

# %%
printed = tables.case_means()
setting = results.setting(published)
NotebookFigure(level_figures.by_levels(level_means(published, printed), setting))

# %% [markdown]
# ## The reconstructed campaign
#
# *Reconstructed, not measured.* To be quick this notebook samples two chains; `make fit` runs the same model with
# four, into `results/fit` (README shows its table). What was not sampled well enough would be named here. The Monte
# Carlo error is that of what the figures show: the share of an interval's width by which another run of this length
# would differ.

# %%
records = bt.reconstruct_campaign().records
two_chains = bt.SamplerSettings(chains=2, warmup=600, draws=2000)
reconstructed = bt.fit(records, two_chains)
verdict = reconstructed.attrs["verdict"]
print(f"reconstructed, not measured: {two_chains.chains} chains of {two_chains.draws}; verdict: {verdict}")
for sentence in () if verdict == "pass" else bt.diagnose(reconstructed).reasons:
    print("-", sentence)
cases = bt.cases(reconstructed)
error = (cases["mcse_mean"] / (cases["upper"] - cases["lower"])).max()
print(f"k and beta of every case: R-hat at most {cases['r_hat'].max():.3f}, error at most {error:.0%} of an interval")

# %% [markdown]
# ## How stiff would records like these say single and dual are?
#
# *Reconstructed, not measured.* The same figure as above. The intervals are narrower, for a record says more than a
# printed mean; but how much the repeats scatter was assumed.

# %%
bt.figure(reconstructed, "posteriors_by_direction")

# %% [markdown]
# ## What would records like these say of speed, load and step?
#
# *Reconstructed, not measured.*

# %%
NotebookFigure(level_figures.by_levels(level_means(reconstructed, printed), results.setting(reconstructed)))

# %% [markdown]
# ## Which is stiffer, and by how much?
#
# *Published numbers in black; reconstructed, not measured, in grey.*
# `dual / single` sets each case against the same case of the other configuration. Loading over unloading can be
# matched in two ways, and they answer different questions: *same span* goes over the same loads up and down (20-30 kN
# against 30-20), *same initial load* starts at the same load (20-30 against 20-10). `pooled as published` is the
# source's comparison, which mixes speeds.

# %%
kinds = {"published tables": published, "reconstructed records": reconstructed}
ratios = {f"{name} (verdict: {tree.attrs['verdict']})": bt.contrasts(tree) for name, tree in kinds.items()}
both = setting._replace(origin="published + reconstructed")
NotebookFigure(average_contrast_figures.average_contrasts(ratios, both))

# %% [markdown]
# ## How sure is that?
#
# *Published and reconstructed: the column `origin` says which.* The same ratios with the probability that they are
# above 1. Near 1 or 0: the data decide. Near 0.5: they do not.

# %%
results.average_table(ratios.values(), "k")

# %% [markdown]
# ## And beta?
#
# *Published and reconstructed: the column `origin` says which.* beta of loading over beta of unloading is above 1 by
# the one matching and below 1 by the other: the ratio says how cases were matched, not how the tyre is.

# %%
results.average_table(ratios.values(), "beta")

# %% [markdown]
# ## What does it mean for the ride?
#
# *Published numbers.* The stiffer the tyre, the more of a road's unevenness reaches the axle as force, and the faster
# the axle bounces on it: a mass on its tyre alone bounces at a frequency that goes with the root of k. Two equal
# tyres on one hub are twice as stiff as one of them. The single here is another, wider tyre, so nothing says 2; the
# table says what was found, and what it leaves to each tyre of the pair if they share the load evenly. (The axles'
# masses differ, 290 kg and 305 kg, and are left out.)

# %%
of = bt.contrasts(published)
average = of[(of["contrast"] == "dual / single") & (of["parameter"] == "k") & of["step_kN"].isna()]
ratio = average.set_index(average["direction"].fillna("both"))[["median", "lower", "upper"]]
meaning = {"k, dual / single": ratio, "k, one of the pair / single": ratio / 2, "frequency, dual / single": ratio**0.5}
pd.concat(meaning).astype(float).round(2)

# %% [markdown]
# The source itself leaves out what this does to comfort ("beyond the scope"), and nothing here was measured on a
# vehicle.
#
# ## What does it mean for rolling loss?
#
# Nothing that can be read off these numbers. The energy that a tyre loses in a cycle is the area between its loading
# and unloading curves, which rests on friction. Equation 2 does not tell friction from stiffness: k and beta of a
# step do not hold it. A larger beta means that the force follows its line later after the start of a step, not that
# more is lost.
#
# ## What not to believe
#
# - That `dual / single` of k differs from case to case by the published numbers: one value a case was printed, so
#   that model has one ratio for all cases of a direction.
# - Any interval here as a statement about the processing. The source leaves the axle's inertia out and smooths over
#   twice the response's length. On simulated recordings that makes beta a property of the filter, and moves k (`make
#   demo` prints by how much). Whether a ratio of two k suffers less is not known.
# - A common error of the displacement sensor is in every k (the source's dial gauge differs by 7.5 %); it is in no
#   ratio.
# - `pooled as published` as an effect of direction: loading stands still, unloading mostly rolls.
