"""What is said of divergent transitions: what helps, and what the repeat that came of them had."""

from collections.abc import Sequence

from bayes_tyre.inference.sampling.run import ACCEPTANCE_MOST, SamplerRun

_SIMPLER = "give more informative --priors, or a simpler model (--repeats normal, --noise iid)"


def against_divergences(target: float | None) -> str:
    """Return what to do about divergences at a target acceptance: shorter steps while there are any, then the model."""
    if target is None or target < ACCEPTANCE_MOST:
        was = "" if target is None else f" (it was {target:g})"
        return f"raise --target-accept to {ACCEPTANCE_MOST:g}{was}; if they stay, {_SIMPLER}"
    return _SIMPLER


def longer_note(runs: Sequence[SamplerRun]) -> str:
    """Return that the run which was kept went on beyond the draws asked for; empty where it did not."""
    every = next((one.every for one in runs if one.kept), 1)
    return "" if every == 1 else f"sampled {every} times as long, one of {every} draws kept: R-hat or an ESS fell short"


def repeat_note(runs: Sequence[SamplerRun]) -> str:
    """Return what the runs of a repeat had, in a sentence; empty for a single run."""
    if len(runs) < 2:
        return ""
    each = ", ".join(
        f"{one.divergences} divergent transitions at target acceptance {one.target_accept:g}"
        + (", records integrated out" if one.sampler == "collapsed" else "")
        + (" (kept)" if one.kept else "")
        for one in runs
    )
    return f"sampled {'twice' if len(runs) == 2 else f'{len(runs)} times'}: {each}"
