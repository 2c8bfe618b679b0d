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
# # 1. The thesis's numbers, computed again
#
# The source is *Characterising the stiffness and hysteresis of single and dual truck tyres* (University of the
# Witwatersrand, 2019). It prints tables and a few rows of one recording; the raw data are not public. This notebook
# recomputes what can be recomputed from print, lists what does not recompute, and shows that least squares returns
# the printed k and beta from records that were made from them.
#
# Units: k in kN/mm, beta in mm, forces in kN.

# %%
import pandas as pd
from support import reproduction_figures

import bayes_tyre as bt
from bayes_tyre.inference.least_squares.table import FitSettings
from bayes_tyre.published import campaign, checks, recompute, tables
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure

pd.set_option("display.max_colwidth", 90)

# %% [markdown]
# ## Which printed numbers come back?
#
# *Published numbers.* `agrees` means: within half a unit of the last printed digit. Twelve of these numbers the
# source does not print; this project states them from its printed rows, and the column `source` says so.

# %%
recomputed = checks.recomputed_rows()
print(f"{recomputed['agrees'].sum()} of {len(recomputed)} recomputed numbers agree")
recomputed[["quantity", "source", "published", "recomputed", "agrees"]].round(4).set_index("quantity")

# %% [markdown]
# ## What does not recompute?
#
# *Published numbers.* Errata found by computing again: what is printed and what comes out;
# `data/published/errata.csv` says why. None of them changes k or beta of a case. The two that matter for reading the
# source are the means of unloading: they hold four speeds where the means of loading hold standstill only, so its
# headline comparison of loading and unloading mixes direction with speed.

# %%
errata = tables.errata()
agree = checks.erratum_rows()["agrees"]
print(f"{len(errata)} errata; {agree.sum()} of {len(agree)} with a number give the corrected value when run")
matters = errata[errata["item"].str.startswith(("Section", "Reliability", "Appendix B5", "Nomenclature"))]
matters.set_index("item")[["printed", "recomputed"]]

# %%
rest = errata.drop(matters.index)
rest.set_index("item")[["printed", "recomputed"]]

# %% [markdown]
# ## Which signs did the printed recording lose?
#
# *Published numbers.* Appendix B1 prints 27 rows of one recording, volts beside engineering units. Readings of a
# sensor lie on a line over its volts. Seven accelerations do not, unless a minus sign is put back.

# %%
printed, mended = tables.raw_sample(mended=False), tables.raw_sample()
NotebookFigure(reproduction_figures.calibration_lines(printed, mended, recompute.SENSORS))

# %% [markdown]
# ## What are the calibration lines?
#
# *From the published rows.* Value = slope x volts + intercept, by least squares over all 27 rows, signs mended. The
# step is what one step of the converter is worth: the load cell is coarse, the accelerometer fine.

# %%
lines = pd.DataFrame(recompute.calibration_lines(), index=["slope (unit/V)", "intercept (unit)"]).T
lines["channel and unit"] = [unit for _, unit in recompute.SENSORS.values()]
steps = recomputed[recomputed["quantity"].str.contains("step")]
print(steps[["quantity", "recomputed"]].to_string(index=False))
lines.round(4)

# %% [markdown]
# ## Does least squares return the printed k and beta?
#
# *Reconstructed records, not measured.* 144 records (48 cases, three repeats) were made so that the source's own
# procedure returns its printed values. That they come back checks this software, not the source. The procedure: the
# first 70 % of each record, its first point as the start, a repeat left out of the mean where it differs from the
# other two by more than 6 times the usual scatter (the source gives no number: this one is ours).

# %%
records = bt.reconstruct_campaign().records
fits = bt.fit_least_squares(records, FitSettings(region="thesis"))
check = checks.round_trip_rows(campaign.case_means(fits))
print(f"{(fits['status'] == 'ok').sum()} of {len(fits)} records: status ok (reconstructed, not measured)")
print(f"{check['agrees'].sum()} of {len(check)} printed numbers come back")
returned = check[~check["quantity"].str.startswith("tests")]
NotebookFigure(reproduction_figures.returned_numbers(returned, "reconstructed"))

# %% [markdown]
# ## What do the fits of one case look like?
#
# *Reconstructed records, not measured.* Three repeats of one case, each with the standard error that least squares
# gives. The second repeat is discordant. Whether to leave it out is the subject of notebook 3.

# %%
one = fits[fits["record"].str.startswith("DynamicS(0)20-25")]
columns = ["k_kN_per_mm", "k_kN_per_mm_se", "beta_mm", "beta_mm_se", "C_kN", "rmse_kN", "points", "status"]
one.set_index("record")[columns].round(5)

# %% [markdown]
# ## What not to believe
#
# - The printed k and beta of a case cannot be checked: the recordings behind them are not public.
# - The source leaves the axle's inertia out and smooths a response of about 40 ms over 80 ms. What that does to k and
#   beta is measured on simulated recordings by `make demo`; notebook 5 shows the other way of processing.
# - Speed and direction are confounded in the printed averages (second table above).
