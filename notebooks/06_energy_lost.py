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
# # 6. How much energy does a tyre lose?
#
# A tyre that is pressed and let go again does not give back all that went in: its force on the way up is not that on
# the way down, and the area between the two is lost as heat. The source wanted that energy and could not get it, for
# Equation 2 does not tell friction from stiffness. The axle's motion does: after a step the axle rings on the tyre,
# through many small loops.
#
# **All data here are simulated, not measured**, so that the truth is known. k: stiffness (kN/mm). x: friction (kN).
# beta: how far the tyre moves until its friction has settled (mm).

# %%
from pathlib import Path

import pandas as pd
from support import motion_figures, motion_truth

from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.inference.motion.record import estimate
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle, loop_energy
from bayes_tyre.report.figures import process as process_figures
from bayes_tyre.report.figures.page.notebook_display import NotebookFigure
from bayes_tyre.rig import axle, geometry, sensors
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals import factors, inertia, process
from bayes_tyre.simulate.plan import quick_plan
from bayes_tyre.workflow.raw.simulate import write_simulated

# %% [markdown]
# ## What is lost in a cycle?
#
# *Simulated, not measured.* A tyre of chosen k, x and beta, moved up and down by 2 mm. At the left the loop is thin
# beside the force of the spring; at the right the spring is taken off. Where the tyre turns, its friction does not turn
# at once but over beta; then the two ways lie 2 (x - k beta) apart.

# %%
prepare_jax()
tyre, amplitude = {"k": 1.8, "x": 0.45, "beta": 0.08}, 2.0
loop = motion_truth.true_loop(**tyre, amplitude_mm=amplitude).rename(columns={"median_kN": "friction_kN"})
loop["force_kN"] = tyre["k"] * loop["displacement_mm"] + loop["friction_kN"]
NotebookFigure(motion_figures.loop_figure(loop, amplitude))

# %% [markdown]
# *Simulated, not measured.* The area by its points, and by the formula 4 (x - k beta)(a - beta tanh(a / beta)):

# %%
area = float(loop_energy(loop["displacement_mm"].to_numpy(), loop["force_kN"].to_numpy()))
formula = float(dissipated_energy_per_cycle(**tyre, amplitude=amplitude))
apart = 2 * (tyre["x"] - tyre["k"] * tyre["beta"])
print(f"simulated: area {area:.4f} J, formula {formula:.4f} J on flat ground; 2 (x - k beta) = {apart:.3f} kN")

# %% [markdown]
# ## What is recorded?
#
# *Simulated, not measured.* Four raw files of a standing axle, loaded and unloaded by 10 kN. The step takes some 40 ms;
# what says most about the loop is the ringing behind it, which the source cut away.

# %%
rig, raw = axle.load_rig("single"), Path("raw")
plan = [one for one in quick_plan(rate_Hz=5000) if (one.case.configuration, one.repeat) == ("single", 1)]
truth = pd.read_csv(write_simulated(plan, {"single": rig}, 0, raw, lambda _: None))


def prepared(one) -> process.Recording:
    """Return a file's recording, its step found."""
    named = factors.RecordFactors(one.record, one.case, one.repeat)
    return process.prepare(read_raw(raw / one.file, sensors.columns_of(rig)), rig, named)


recordings = {one.record: prepared(one) for one in plan}
NotebookFigure(process_figures.record_figure(inertia.inertia(recordings["S(0)30-20(1)"], rig), "simulated"))

# %% [markdown]
# ## What does each motion say?
#
# *Simulated, not measured.* The motion of mass and tyre is fitted to all three channels of each file. What comes back
# is not one number but draws of k, x, beta, mass m (kg) and damping c (kN s/mm) that go together. (`bayes-tyre motion
# raw --out DIR` does this for a folder of files, and puts all of them into one hierarchy.)


# %%
def estimated(recording: process.Recording):
    """Return the estimate of one record's motion."""
    read, step = recording.raw, recording.step
    channels = read.acceleration_m_per_s2, read.laser_mm, read.load_kN
    ramp_s = step.ramp.start_s, step.ramp.end_s
    return estimate.estimate_motion(rig, estimate.Recorded(read.dt_s, *channels, pre_step=step.pre_step, ramp_s=ramp_s))


estimates = {record: estimated(recording) for record, recording in recordings.items()}
for record, one in estimates.items():
    print(f"{record}, simulated, not measured: {one.status or 'ok'}; {one.effective_draws:.0f} effective draws")


# %%
def beside(record: str, amplitude_mm: float) -> pd.DataFrame:
    """Return parameters and losses of one record beside the truth."""
    one, true = estimates[record], truth.set_index("record").to_dict("index")[record]
    at = pd.Series(true)[["k_kN_per_mm", "x_kN", "beta_mm", "m_kg", "c_kN_s_per_mm"]].to_numpy(float)
    middle = geometry.wheel_centre_start(rig, (true["load_before_kN"] + true["load_after_kN"]) / 2, at[0])
    table = motion_truth.beside_truth(rig, one.log_draws, one.weights, at, middle, amplitude_mm)
    return table.assign(record=record, amplitude_mm=amplitude_mm)


found = pd.concat([beside(record, amplitude) for record in estimates])

# %% [markdown]
# ## How near is it to the truth?
#
# *Simulated, not measured.* All that a record gives, as per cent off what was put in: the five parameters, and what
# follows from them for a cycle of 2 mm at the wheel centre.

# %%
NotebookFigure(motion_figures.off_the_truth(found))

# %% [markdown]
# ## What does a cycle lose?
#
# *Simulated, not measured.* A cycle of 2 mm either way at the wheel centre: energy (J); loss factor (energy over 2 pi
# times the energy stored); the viscous damping (kN s/mm) that would lose as much; how far apart the settled branches
# lie on flat ground (kN). `truth` is computed by the same formula from the parameters that were put in.

# %%
lost = found[found["quantity"].isin([name for name, _ in motion_truth.LOSSES])]
shown = lost.set_index(["quantity", "unit", "record"]).sort_index()
shown[["truth", "median", "lower", "upper"]].map("{:.4g}".format)

# %% [markdown]
# ## And at another stroke?
#
# *Simulated, not measured.* Friction takes the same from every millimetre, so that a long cycle loses in proportion to
# its stroke, and a cycle of few beta much less. Beyond what the record went through, this is the law's word.

# %%
strokes = pd.concat([beside("S(0)30-20(1)", stroke) for stroke in (0.1, 0.5, 1.0, 2.0, 4.0)])
energy = strokes[strokes["quantity"] == "energy a cycle"].set_index("amplitude_mm")
energy[["truth", "median", "lower", "upper"]].round(4).rename_axis("amplitude (mm); energy in J")

# %% [markdown]
# ## What not to believe
#
# - That a real tyre is as kind: the simulated one follows the very law that is fitted. A tyre with another law has
#   another loop, and these intervals do not know it.
# - The energy as a rolling loss: a rolling tyre goes round its whole circumference, not up and down. The loop tells
#   what the vertical motion of an axle loses.
# - An energy on flat ground beside one at the wheel centre: the rollers' geometry makes them differ. Tables state it at
#   the wheel centre.
