"""What makes a posterior not worth having however well the sampler did: one sentence each, with what to do."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.hierarchical import JUDGEABLE_REPEATS
from bayes_tyre.inference.levels import find_levels
from bayes_tyre.inference.priors import PRIORS
from bayes_tyre.record import CASE_WORDS

#: A logarithm whose posterior is this wide relative to its prior was not told anything by the records.
UNINFORMED = 0.7
#: Scatter among repeats of one test (of the logarithm) above which they are none: the priors' upper ends, doubled.
SCATTER_MOST = {"k": 0.5, "beta": 1.0}
#: No load cell is as quiet as a millinewton, kN.
NOISE_LEAST_KN = 1e-6


def find_doubts(posterior: xr.Dataset) -> list[str]:
    """Return why the records cannot support what is asked of them: the parameter, the figure, and what to do.

    Parameters
    ----------
    posterior:
        Dims chain, draw and those of `bayes_tyre.inference.posterior.QUANTITIES`.
    """
    return [*_uninformed(posterior), *_no_repeats(posterior), *_outvoted(posterior), *_noiseless(posterior)]


def _uninformed(posterior: xr.Dataset) -> Iterator[str]:
    for parameter, remedy in (
        ("k", "check the signs and columns of these records, or leave them out"),
        ("beta", "it needs several points within beta of the start, and travel well beyond it"),
    ):
        name = f"{parameter}_cell"
        if name not in posterior:
            continue
        draws = posterior[name].transpose("chain", "draw", "cell")
        shares = np.log(draws.to_numpy()).std(axis=(0, 1)) / PRIORS[name].parameters[1]
        for label, share in zip(draws["cell"].to_numpy(), shares, strict=True):
            if not share > UNINFORMED:
                continue
            yield (
                f"{name}[{label}]: not determined by the records: its posterior is {share:.0%} as wide as its prior; "
                f"{remedy}"
            )


def _no_repeats(posterior: xr.Dataset) -> Iterator[str]:
    for parameter, most in SCATTER_MOST.items():
        name = f"log_{parameter}_repeat_scatter"
        if name in posterior and (scatter := float(posterior[name].median())) > most:
            yield (
                f"{name}: repeats of a case differ by a factor of {np.exp(scatter):.1f}: no value stands for the case; "
                "check that equal words mean equal tests, and that all records have the same units"
            )


def _outvoted(posterior: xr.Dataset) -> Iterator[str]:
    if "discordant_probability" not in posterior:
        return
    odd = (posterior["discordant_probability"].mean(("chain", "draw")) > 0.5).to_numpy()
    words = pd.DataFrame(
        {word: posterior[f"record_{word}"] for word in CASE_WORDS if f"record_{word}" in posterior.coords},
        index=range(len(odd)),
    )
    levels = find_levels(words)
    discordant = np.bincount(levels.of_record, weights=odd, minlength=len(levels.cases))
    for case, found, repeats in zip(levels.cases, discordant, levels.repeats, strict=True):
        if repeats >= JUDGEABLE_REPEATS and 2 * found >= repeats:
            yield (
                f"k[{case.label}]: {found:.0f} of its {repeats} repeats are discordant: nothing says which to believe; "
                "repeat the test"
            )


def _noiseless(posterior: xr.Dataset) -> Iterator[str]:
    if "sigma" not in posterior:
        return
    sigma = posterior["sigma"].median(("chain", "draw"))
    least = sigma.idxmin().item()
    if float(sigma.min()) < NOISE_LEAST_KN:
        yield (
            f"sigma[{least}]: {float(sigma.min()):.1g} kN is no noise of a sensor: computed records cannot be "
            "sampled; use lsq, or add the noise that a load cell would have"
        )
