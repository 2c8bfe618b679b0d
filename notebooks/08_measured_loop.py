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
# # 8. Does a measured loop follow Equation 2?
#
# The other notebooks rest on printed tables, on records reconstructed from them, or on simulations. Here are two curves
# that somebody **measured**, neither of a tyre: a steel slit damper, whose steel yields, and a magnetorheological
# damper, whose oil resists the faster the more it is moved. The first should follow the law for friction in Equation 2
# and the second should not; the tool has to tell them apart.
#
# Sources: Chan and Albermani (2008), digitised by github cslotboom/hysteresis (Apache-2.0); UTFPR, Brazil, github
# labcontrol-data/mr-damper (MIT). Both licences are in `data/measured/`.

# %%
import pandas as pd

import bayes_tyre as bt
from bayes_tyre.embedded import data_path
from bayes_tyre.inference.least_squares.loops import backbone, cycle_table, law_curves
from bayes_tyre.record_table import check_record_table
from bayes_tyre.report.figures.loops import driven_loops
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure
from bayes_tyre.signals.reversals import cut_loops

# %% [markdown]
# ## Where is a curve cut, and does each branch follow the law?
#
# *Measured.* A driven curve is cut at its reversals, and Equation 2 is fitted to each branch by itself. Points: the
# readings. Lines: the law as fitted. Dashed: the mean of loading and unloading, a cycle.


# %%
def branches_of(name: str) -> pd.DataFrame:
    """Return the branches of one of the measured curves (mm, kN)."""
    curve = pd.read_csv(data_path(f"measured/{name}.csv"))
    return cut_loops(check_record_table(curve.assign(record=name, origin="measured")))


def figure_of(branches: pd.DataFrame, fits: pd.DataFrame) -> NotebookFigure:
    """Return the figure of branches with the law as fitted to each."""
    setting = Setting("measured", configurations=("",))
    return NotebookFigure(driven_loops(branches, law_curves(branches, fits), backbone(branches), setting))


steel = branches_of("steel_slit_damper")
steel_fits = bt.fit_least_squares(steel)
figure_of(steel, steel_fits)

# %% [markdown]
# ## How much energy does a cycle lose?
#
# *Measured.* The area of the loop needs no law. Where the law fits both branches (`ok`), its energy is within 1 % of
# the area. Where it does not, `status` says why: too few points to know beta, or residuals with a course.

# %%
cycles = cycle_table(steel, steel_fits, backbone(steel))
columns = ["cycle", "travel_mm", "energy_J", "law_energy_J"]
shown = cycles[columns].round(1).assign(law_over_area=(cycles["law_energy_J"] / cycles["energy_J"]).round(3))
print(shown.assign(status=cycles["status"].str.slice(0, 56)).to_string(index=False))

# %% [markdown]
# *Measured.* k falls from cycle to cycle: the strokes grow, and more of the steel yields. In a tyre likewise one step's
# k is not that of another step's size, which is why the hierarchy has a term for it.

# %%
ok = steel_fits[steel_fits["status"] == "ok"]
ok[["record", "k_kN_per_mm", "k_kN_per_mm_se", "beta_mm", "beta_mm_se"]].round(3)

# %% [markdown]
# ## And a damper whose force follows speed?
#
# *Measured.* The force is greatest in the middle, where the damper moves fastest, and falls towards both ends. The
# law's branches are straight there. They miss the readings in the same way every time, by more than these scatter.

# %%
oil = branches_of("magnetorheological_damper")
oil_fits = bt.fit_least_squares(oil)
figure_of(oil, oil_fits)

# %% [markdown]
# *Measured.* No branch is called `ok`, so none of its k and beta is to be used. The energy by the area does not depend
# on the law and stays good.

# %%
wrong = oil_fits["status"].str.contains("not Equation 2").sum()
energy = cycle_table(oil, oil_fits, backbone(oil))["energy_J"]
print(f"measured: {(oil_fits['status'] == 'ok').sum()} of {len(oil_fits)} branches ok; {wrong} are not Equation 2")
print(f"measured: energy of a cycle {energy.iloc[-1]:.2f} J by the area, {energy.min():.2f} to {energy.max():.2f} J")
