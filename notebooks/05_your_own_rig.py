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
# # 5. Your own rig: from raw files to a report
#
# A machine of your own is a short text file, and the recordings are a folder. This notebook goes from both to a
# posterior and a report, with the commands that you would type. **Its recordings are simulated, not measured**, so
# that the truth is known; with your own, start at "What is in a file?".
#
# Each command is written as on a terminal, less the word `bayes-tyre`.

# %%
import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
from support.stored_figure import StoredFigure

here = Path("results/05_your_own_rig")
here.mkdir(parents=True, exist_ok=True)


# %%
def bayes_tyre(*words: str) -> None:
    """Run a command in the folder and print what it says, in plain text; a code other than 0 is printed too."""
    command = [sys.executable, "-m", "bayes_tyre", *words]
    plain = {name: value for name, value in os.environ.items() if "COLOR" not in name}
    done = subprocess.run(command, cwd=here, env=plain, capture_output=True, text=True, check=False)
    said = [done.stdout.strip(), *([done.stderr.strip(), f"code {done.returncode}"] if done.returncode else [])]
    print(*filter(None, said), sep="\n")


# %% [markdown]
# ## What does the program need to know of the machine?
#
# A lever presses the tyre on a flat platen: the lever's lengths, what the axle itself puts on the tyre, and what
# moves with the wheel, weighed or guessed. Every key is explained in `data/rigs/README.md`, with rollers, voltages
# and signs.

# %%
rig = """\
name = "flat_ground"

[axle]
support_to_wheel_centre_mm = 1200.0
support_to_load_mm = 800.0
support_to_measurement_mm = 1000.0
axle_load_kN = 2.0
effective_mass_kg = 250.0
effective_mass_relative_sd = 0.2
"""
_ = (here / "rig.toml").write_text(rig, encoding="utf-8")

# %% [markdown]
# ## Where do these recordings come from?
#
# *Simulated, not measured.* An axle that moves on tyres of known k and beta, with noise and converter steps, written
# as the source's LabVIEW files. Yours may be `.lvm`, `.tdms`, `.xlsx`, `.csv` or `.parquet`. The factors of a test come
# from names such as `DynamicS(0)30-20(1).lvm` (single, 0 km/h, 30 to 20 kN, first repeat), or from a table given as
# `--cases`.

# %%
bayes_tyre("simulate", "--plan", "quick", "--rig", "rig.toml", "--rate", "2500", "--out", "raw")

# %% [markdown]
# ## What is in a file?
#
# *Simulated, not measured.* Names, units and ranges of its channels: look whether the units are m/s^2, mm and kN.

# %%
bayes_tyre("inspect", "raw/DynamicS(0)20-30(1).lvm", "--out", "channels.csv")
channels = pd.read_csv(here / "channels.csv").set_index("channel")
channels[["unit", "samples", "dt_s", "first", "last", "min", "max", "missing"]].round(4)

# %% [markdown]
# ## Which recordings can be used?
#
# *Simulated, not measured.* `process` finds the step, takes the axle's inertia off the load, and writes force over
# displacement. What cannot be used stands in `rejected.csv` with the reason; nothing is dropped in silence.

# %%
bayes_tyre("process", "raw", "--rig", "rig.toml", "--out", "records.csv", "--workers", "1")
pd.read_csv(here / "rejected.csv")

# %% [markdown]
# ## What do all recordings say together?
#
# *Simulated, not measured.* To be quick: two chains, and repeats are taken as normal, without the discordant ones of
# notebook 3 (`--repeats normal`: fewer unknowns). Leave these options out for your own. Exit code 4 and the verdict
# `fail` would mean: written, but not to be trusted; the reasons then say what to do. The figures are those that `fit`
# writes.

# %%
few = ["--chains", "2", "--warmup", "600", "--draws", "900", "--repeats", "normal"]
bayes_tyre("fit", "records.csv", "--out", "fit", "--quiet", *few)
diagnostics = json.loads((here / "fit" / "diagnostics.json").read_text(encoding="utf-8"))
print("simulated, not measured; verdict:", diagnostics["verdict"])
StoredFigure(here / "fit", "posteriors_by_direction")

# %% [markdown]
# ## Which is stiffer, and how sure is that?
#
# *Simulated, not measured.* Ratios with their intervals, and the probability at the right.

# %%
StoredFigure(here / "fit", "contrasts")

# %% [markdown]
# ## Do the fitted curves follow the records?
#
# *Simulated, not measured.* Look at this before you use a number: points off the band, or residuals with a
# pattern, mean that the law, the mass or the signs do not fit.

# %%
StoredFigure(here / "fit", "records_with_bands")

# %% [markdown]
# ## How near is it to the truth?
#
# *Simulated, not measured:* only a simulation has a truth to compare with. The two betas differ by definition, as the
# last line says; and an interval holds the noise, not that the law's curve is another or the mass uncertain.

# %%
bayes_tyre("show", "--truth", "raw/truth.csv", "fit")

# %% [markdown]
# ## What do I hand on?
#
# *Simulated, not measured.* One page with the verdict, the tables and the figures, that opens without a network. Here
# with the figures as they lie in `fit/figures`, to be quick; without `--kept-figures` they are drawn anew, as sharp as
# any page or screen wants them.

# %%
bayes_tyre("report", "fit", "--kept-figures")
print("size of the page:", round((here / "fit" / "report.html").stat().st_size / 1e6, 1), "MB")

# %% [markdown]
# ## What not to believe
#
# - k is as right as the lever arms and the displacement sensor: an error common to all recordings moves every k
#   together and is in no interval, unless `fit --displacement-scale-sd` says how large it may be.
# - Equation 2 does not tell friction from stiffness, so the energy lost in a cycle is not in these numbers.
# - A folder in which many recordings are rejected: mend the cause before fitting the rest.
