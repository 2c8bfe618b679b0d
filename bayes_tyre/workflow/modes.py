"""A table of natural frequencies in; a flexible ring's parameters, the frequencies beside their fit, a figure out."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput, errors_name
from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables.table_files import read_table, write_table
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.flexible_ring import MeasuredModes, RingFit, fit_ring
from bayes_tyre.record import ORIGIN_UNKNOWN
from bayes_tyre.record_table import origin_of
from bayes_tyre.report.figures.flexible_ring import frequencies_by_mode
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.results.first_mode import first_mode
from bayes_tyre.results.flexible_ring import ring_frequencies, ring_parameters
from bayes_tyre.results.provenance import RUN_JSON, begin_run, write_run
from bayes_tyre.signals.natural_frequencies import CONDITIONS, REQUIRED, WAVES, check_natural_frequencies
from bayes_tyre.workflow.from_results.predict import read_posterior

MODES, FREQUENCIES, FIGURE = "modes.csv", "frequencies.csv", "figures/frequencies_by_mode.png"
SD = "standard_deviation_Hz"
#: Column of `frequencies.csv` where a mode was taken from a result of `motion`, and its two values.
SOURCE, OF_TABLE, OF_MOTION = "source", "table", "motion"
#: mm/s in a km/h.
_MM_PER_S = 1e6 / 3600.0


@dataclass(frozen=True)
class Belt:
    """What frequencies cannot say of a belt: its radius, mm, and its mass per length, kg/m; None where not known."""

    radius_mm: float | None = None
    mass_kg_per_m: float | None = None


@dataclass(frozen=True)
class Motion:
    """A result of `motion --law rigid_ring` whose first mode is fitted too; configuration None: of the only one."""

    folder: Path
    configuration: str | None = None


def fit_modes(
    path: Path,
    out: Path,
    belt: Belt,
    command: Sequence[str],
    *,
    motion: Motion | None = None,
    interval: float = 0.95,
    seed: int = 0,
) -> tuple[pd.DataFrame, RingFit]:
    """Fit a flexible ring to a table of frequencies and write the result's folder; return `modes.csv` and the fit.

    Raises
    ------
    BadInput
        If the table, the motions or `out` cannot be used, or the tyre turns and the belt's radius is not given.
    """
    began = time.monotonic()
    table = check_natural_frequencies(read_table(path), str(path))
    options = {"interval": interval, "radius_mm": belt.radius_mm, "mass_per_length_kg_per_m": belt.mass_kg_per_m}
    inputs, untrusted = [path], []
    if motion is not None:
        table, posterior, untrusted = _with_motion(table, motion, path)
        options, inputs = {**options, "configuration": motion.configuration}, [path, posterior]
    modes = _measured(table, belt, path)
    priors = {name: prior.given() for name, prior in modes.priors.items()}
    run = begin_run(command, {**options, "priors": priors}, seed, inputs, origin_of(table), began)
    prepare_folder(out)
    (out / RUN_JSON).unlink(missing_ok=True)  # of an older run: it marks a folder as finished
    fit = fit_ring(modes, seed)
    fit = fit._replace(checks=[*fit.checks, *untrusted])
    about = {"origin": origin_of(table), "verdict": fit.verdict}
    scales = {"radius_mm": belt.radius_mm, "mass_kg_per_m": belt.mass_kg_per_m}
    parameters = ring_parameters(modes, fit, interval, **scales).assign(**about)
    given = [column for column in ("mode", *CONDITIONS, "frequency_Hz", SD, SOURCE) if column in table]
    frequencies = pd.concat([table[given], ring_frequencies(modes, fit, interval)], axis=1).assign(**about)
    write_table(parameters, out / MODES)
    write_table(frequencies, out / FREQUENCIES)
    setting = Setting(origin_of(table), fit.verdict)
    note = "A thin, inextensible ring on an elastic foundation; modes between measured ones are joined by lines."
    save(frequencies_by_mode(frequencies, _conditions(table), setting, note), out / FIGURE)
    write_run(run, out, device=jax.default_backend())
    return parameters, fit


def _with_motion(table: pd.DataFrame, motion: Motion, path: Path) -> tuple[pd.DataFrame, Path, list[Check]]:
    """Return the table with the first mode of motions as its last row, their posterior's file, and what fails with it.

    Mode 1 has no tension in it and one wave: neither pressure nor speed changes it.
    """
    if SD not in table:
        raise BadInput(f"{path}: has no column {SD}; with --motion each frequency needs one, or leave --motion out")
    posterior, tree, verdict = read_posterior(motion.folder)
    with errors_name(posterior):
        mode = first_mode(tree, motion.configuration)
    row = {"mode": 1.0, "frequency_Hz": mode.frequency_Hz, SD: mode.sd_Hz, "origin": tree.attrs["origin"]}
    row |= {name: nothing for name, nothing in (("speed_km_h", 0.0), ("wave", "")) if name in table}
    table = table.assign(**{SOURCE: OF_TABLE, "origin": table.get("origin", ORIGIN_UNKNOWN)})
    joined = pd.concat([table, pd.DataFrame([{**row, SOURCE: OF_MOTION}])], ignore_index=True)
    finding = f"the verdict on {motion.folder} is fail, and the first mode comes from it"
    check = Check("motion", "data", verdict == "pass", np.nan, np.nan, "mode 1", finding, "leave --motion out")
    return joined, posterior, [check]


def _measured(table: pd.DataFrame, belt: Belt, path: Path) -> MeasuredModes:
    speed = table["speed_km_h"] if "speed_km_h" in table else pd.Series(0.0, index=table.index)
    if belt.radius_mm is None and speed.gt(0).any():
        raise BadInput(f"{path}: speed_km_h above 0 turns the ring; give its --radius in mm, or leave these rows out")
    wave = table["wave"].map(WAVES).fillna(0.0) if "wave" in table else pd.Series(0.0, index=table.index)
    mode, frequency = (table[column].to_numpy(float) for column in REQUIRED)
    sd = table[SD].to_numpy(float) if SD in table else None
    # A mode of motions has no pressure: any serves, as mode 1 has no tension in it.
    pressure = table["pressure_bar"].bfill().ffill().to_numpy(float) if "pressure_bar" in table else None
    spin = speed.to_numpy(float) * _MM_PER_S / (belt.radius_mm or np.inf)
    return MeasuredModes(mode, frequency, sd, pressure, spin, wave.to_numpy(float))


def _conditions(table: pd.DataFrame) -> pd.Series:
    """Return what each row was measured under, in a few words."""
    texts = pd.Series("", index=table.index)
    for column, unit in (("pressure_bar", " bar"), ("speed_km_h", " km/h"), ("wave", "")):
        if column in table:
            texts += table[column].map(lambda value, unit=unit: f"{value:g}{unit} " if unit else f"{value} ")
    if SOURCE in table:
        texts = texts.mask(table[SOURCE] == OF_MOTION, "by motion")
    return texts.str.strip()
