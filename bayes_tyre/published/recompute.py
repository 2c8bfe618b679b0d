"""Recomputation of the published values from the tables, the rig files and the raw sample."""

from collections.abc import Sequence

import pandas as pd

from bayes_tyre.laws.fancher import equation_2
from bayes_tyre.published import tables
from bayes_tyre.published.tables import STIFFNESS
from bayes_tyre.rig import axle, beam, geometry
from bayes_tyre.rig.calibration import Line, fit_line, quantisation_step

GROUP = ("configuration", "direction")
SPEED_GROUP = ("configuration", "direction", "speed_km_h")
CONFIGURATIONS = ("single", "dual")
#: The load at which appendix B3 takes deflection and slope.
BEAM_LOAD_kN = 45.0
#: Quantity -> its voltage and its engineering unit in the raw sample.
SENSORS = {
    "acceleration": ("Raw Acc Voltage", "Acc m/s^2"),
    "displacement": ("Raw Disp Voltage", "Disp mm"),
    "load": ("Raw Load Voltage", "Load kN"),
}


def group_means(cases: pd.DataFrame, keys: Sequence[str], parameter: str) -> pd.DataFrame:
    """Return the mean of a parameter (in its own unit) in each group of the keys; NaN if a case of it is missing."""
    groups = cases.groupby(list(keys))[parameter]
    return groups.agg(lambda values: values.mean(skipna=False)).reset_index()


def numbers_outside_tables() -> dict[str, float]:
    """Return the numbers of `text_and_appendices.csv` that can be recomputed, by its `quantity`, in its units."""
    single, dual = (axle.load_rig(name) for name in CONFIGURATIONS)
    values = {
        "single, h": geometry.centre_height_mm(single),
        "dual, h": geometry.centre_height_mm(dual),
        "single, curvature factor": geometry.curvature_factor(single),
        "dual, curvature factor": geometry.curvature_factor(dual),
        "single, second moment": beam.second_moment_m4(beam.beam_of(single)) * 1e5,
        "single, axle load on the tyre": beam.axle_load_on_tyre_kN(single),
        "single, slope at 45 kN": beam.beam_slope_rad(single, BEAM_LOAD_kN, _printed_second_moment_m4("single")) * 1e3,
    }
    for sensor, line in calibration_lines().items():
        values[f"{sensor} line, slope"], values[f"{sensor} line, intercept"] = line
    return values | _quantisation_steps() | _displacement_deviations()


def calibration_lines() -> dict[str, Line]:
    """Return the least-squares lines of acceleration, displacement and load over the mended sample of appendix B1.

    Slopes are in m/s^2/V, mm/V, kN/V, intercepts in m/s^2, mm, kN.
    """
    sample = tables.raw_sample()
    return {
        sensor: fit_line(sample[volts].to_numpy(), sample[values].to_numpy())
        for sensor, (volts, values) in SENSORS.items()
    }


def _quantisation_steps() -> dict[str, float]:
    sample = tables.raw_sample()
    steps = {
        f"quantisation step of the {sensor}": quantisation_step(sample[values].to_numpy())
        for sensor, (_, values) in SENSORS.items()
    }
    # One converter digitises all three; levels of the load are adjacent, so that their difference is one step.
    return {"quantisation step": quantisation_step(sample["Raw Load Voltage"].to_numpy()) * 1e3, **steps}


def _displacement_deviations() -> dict[str, float]:
    table = tables.repeat_displacement()
    groups = table.groupby(["speed_km_h", "configuration"])["displacement_mm"]
    spread = (100 * groups.std() / groups.mean()).groupby("speed_km_h").mean()
    return {f"spread of three displacements at {speed:g} km/h": float(spread[speed]) for speed in (0.0, 25.0)}


def _printed_second_moment_m4(configuration: str) -> float:
    # Appendix B3 uses the printed values: the single axle's recomputes, the dual axle's is an erratum.
    if configuration == "single":
        return float(tables.printed_numbers()["single, second moment"].value) * 1e-5
    printed = tables.errata().set_index("item")["printed"].to_dict()
    return float(printed["Appendix B2: dual, second moment (1e-5 m^4)"]) * 1e-5


def corrected_values() -> dict[str, float]:
    """Return recomputed values where the printed ones are wrong, by `item` of `errata.csv`, in the unit it names."""
    return {
        **_corrected_signs(),
        **_corrected_sections(),
        **_corrected_comparisons(),
        "Appendix B5: residual at the start point, over k d_i + C": _residual_at_start(),
        "Reliability: dial gauge above integrated acceleration (%)": _dial_gauge_excess(),
    }


def _corrected_signs() -> dict[str, float]:
    # Extrapolated from the rows that kept their signs, so that a corrected row does not support itself.
    printed, mended = tables.raw_sample(mended=False), tables.raw_sample()
    volts, values = SENSORS["acceleration"]
    lost = (printed[values] != mended[values]).to_numpy()
    line = fit_line(printed.loc[~lost, volts].to_numpy(), printed.loc[~lost, values].to_numpy())
    at = zip(printed.loc[lost, "X_Value"], line(printed.loc[lost, volts].to_numpy()), strict=True)
    return {f"Appendix B1: acceleration at {time:.4f} s (m/s^2)": float(value) for time, value in at}


def _corrected_sections() -> dict[str, float]:
    single, dual = (axle.load_rig(name) for name in CONFIGURATIONS)
    section = beam.beam_of(single)
    exchanged = {"inner_width_mm": section.inner_height_mm, "inner_height_mm": section.inner_width_mm}
    as_formula = beam.second_moment_m4(section.model_copy(update=exchanged))
    slope = beam.beam_slope_rad(dual, BEAM_LOAD_kN, _printed_second_moment_m4("dual"))
    values = {
        "Appendix B2: single, second moment with b_i and h_i in the printed order (1e-5 m^4)": as_formula * 1e5,
        "Appendix B2: single, hub weight within the axle load (N)": beam.hub_weight_N(single),
        "Appendix B2: dual, second moment (1e-5 m^4)": beam.second_moment_m4(beam.beam_of(dual)) * 1e5,
        "Appendix B2: dual, axle load on the tyre (kN)": beam.axle_load_on_tyre_kN(dual),
        "Appendix B3: dual, slope at 45 kN (1e-4 rad)": slope * 1e4,
    }
    for name, rig in (("single", single), ("dual", dual)):
        values[f"Appendix B2: {name}, section area (1e-3 m^2)"] = beam.section_area_m2(beam.beam_of(rig)) * 1e3
        values[f"Appendix B2: {name}, beam volume (1e-3 m^3)"] = beam.beam_volume_m3(rig) * 1e3
        values[f"Appendix B2: {name}, beam weight (N)"] = beam.beam_weight_N(rig)
        values[f"Appendix B2: {name}, hub weight (N)"] = beam.hub_weight_N(rig)
        deflection = beam.beam_deflection_m(rig, BEAM_LOAD_kN, _printed_second_moment_m4(name))
        values[f"Appendix B3: {name}, deflection at 45 kN (1e-4 m)"] = deflection * 1e4
    return values


def _corrected_comparisons() -> dict[str, float]:
    cases = tables.stiffness().query("speed_km_h == 0")
    ours = group_means(cases, GROUP, STIFFNESS).set_index(list(GROUP))[STIFFNESS]
    model = tables.model_and_tests().query("kind == 'model' and speed_km_h == 0")
    printed = model.set_index(list(GROUP))[STIFFNESS]
    values = {}
    for name in CONFIGURATIONS:
        prefix = f"Section 4.3: {name}, loading above unloading at 0 km/h"
        for means, table in ((ours, "Table 9"), (printed, "Table 10")):
            values[f"{prefix}, from {table} (%)"] = 100 * (means[name, "loading"] / means[name, "unloading"] - 1)
        values[f"Section 4.1: {name}, mean k unloading to set against loading (kN/mm)"] = ours[name, "unloading"]
    return values


def _residual_at_start() -> float:
    # Measured force less Eq. 2 at the start of a published case, (0)30-20 single; any envelope would do.
    k = tables.tests_stiffness("single", "unloading", 0.0)
    d_i, F_i = geometry.flat_ground_start(axle.load_rig("single"), 30.0, k)
    case = {"k": 1.725, "C": 0.2, "beta": 0.02297}
    predicted = equation_2(d_i, d_i=d_i, F_i=F_i, **case)
    return float((F_i - predicted) / (case["k"] * d_i + case["C"]))


def _dial_gauge_excess() -> float:
    printed = tables.printed_numbers()
    gauge = float(printed["dial gauge in the reliability test"].value)
    return 100 * (gauge / float(printed["integrated acceleration in the reliability test"].value) - 1)
