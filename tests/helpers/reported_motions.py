"""Results of `motion` on disk for the report: hand-made draws in the files that it writes, without its figures."""

from pathlib import Path

import numpy as np
import pytest
from helpers.hand_made_posteriors import grid
from helpers.quick_motions import drawn

from bayes_tyre.inference.diagnostics.convergence import with_statistics
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.inference.motion.hierarchy.posterior_losses import Middle, with_losses
from bayes_tyre.report.figures import catalogue
from bayes_tyre.results.provenance import begin_run
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.workflow.result_folder import write_fit


def write_motions(folder: Path, configurations: tuple[str, ...] = ("single", "dual")) -> Path:
    """Write a result of motions of stationary records, a cycle of 2 mm; inputs of other folders differ."""
    factor_table = grid(configurations, repeats=3, speeds=(0.0,))
    zeros = np.zeros((len(factor_table), 5))
    tree = drawn(Motions(factor_table, np.zeros((len(factor_table), 5, 5)), zeros, zeros, zeros))
    tree.attrs |= {"origin": "simulated", "law": "fancher"}
    middles = [Middle(load_rig(name), 10.0) for name in factor_table["configuration"]]
    tree = with_statistics(with_losses(tree, factor_table, middles, 2.0))
    folder.mkdir(parents=True)
    given = folder / "given.txt"
    given.write_text(str(folder))
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        options = {"amplitude_mm": 2.0}
        run = begin_run(["motion", "raw", "--out", "made"], options, 3, [given], "simulated")
        judged = diagnose(tree)
        write_fit(catalogue.Result(tree, judged.verdict), judged, run, folder)
    return folder
