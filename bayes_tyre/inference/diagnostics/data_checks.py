"""What makes a posterior not worth having however well the sampler did, and where its priors speak for the data.

One sentence each, with what to do. Doubts fail the verdict; remarks fail nothing.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.diagnostics.power_scaling import CONTRACTION_LEAST, GROUP, SENSITIVE, identified
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import JUDGEABLE_REPEATS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.record import CASE_FACTORS

#: Scatter among repeats of one test (of the logarithm) above which they are none: the priors' upper ends, doubled.
SCATTER_MOST = {"k": 0.5, "beta": 1.0, "settled": 1.0, "m": 0.3, "c": 1.0}
#: What would make the data speak, by parameter.
REMEDIES = {
    "k": "check the signs and columns of these records, or leave them out",
    "beta": "it needs several points within beta of the start, and travel well beyond it",
    "J": "it needs several points within beta of the start",
    "C": "it needs travel well beyond beta, and several points within beta of the start",
    "sigma": "it needs more points a record",
    "rho": "it needs more points a record",
    "x": "it needs a step that is long beside beta, and a quiet rest before it",
    "settled": "it needs a step that is long beside beta, and a quiet rest before it",
    "m": "it needs the ringing after the step; check the accelerometer's line and sign",
    "c": "it needs the ringing after the step, recorded until it has gone",
    "energy_per_cycle": "it follows x, k and beta",
}
#: Elements that a sentence names.
_NAMED = 3
#: No load cell is as quiet as a millinewton, kN.
NOISE_LEAST_KN = 1e-6


def failed_checks(posterior: xr.Dataset, priors: Priors = PRIORS) -> list[str]:
    """Return why the records cannot support what is asked of them: the parameter, the figure, and what to do.

    Parameters
    ----------
    posterior:
        Dims chain, draw and those of `bayes_tyre.inference.sampling.datatree.QUANTITIES`.
    """
    return [*_uninformed(posterior, priors), *_no_repeats(posterior), *_outvoted(posterior), *_noiseless(posterior)]


def _uninformed(posterior: xr.Dataset, priors: Priors) -> Iterator[str]:
    for parameter in REMEDIES:
        name = f"{parameter}_group"
        if name not in posterior:
            continue
        draws = posterior[name].transpose("chain", "draw", "group")
        shares = np.log(draws.to_numpy()).std(axis=(0, 1)) / priors[name].parameters[1]
        for label, share in zip(draws["group"].to_numpy(), shares, strict=True):
            if not 1.0 - share**2 < CONTRACTION_LEAST:
                continue
            yield (
                f"{name}[{label}]: not determined by the records: its posterior is {share:.0%} as wide as its prior; "
                f"{REMEDIES[parameter]}"
            )


def _no_repeats(posterior: xr.Dataset) -> Iterator[str]:
    for parameter, most in SCATTER_MOST.items():
        name = f"sd_log_{parameter}_repeat"
        if name in posterior and (scatter := float(posterior[name].median())) > most:
            yield (
                f"{name}: repeats of a case differ by a factor of {np.exp(scatter):.1f}: no value stands for the case; "
                "check that equal words mean equal tests, and that all records have the same units"
            )


def _outvoted(posterior: xr.Dataset) -> Iterator[str]:
    if "outlier_probability" not in posterior:
        return
    odd = (posterior["outlier_probability"].mean(("chain", "draw")) > 0.5).to_numpy()
    factor_table = pd.DataFrame(
        {word: posterior[f"record_{word}"] for word in CASE_FACTORS if f"record_{word}" in posterior.coords},
        index=range(len(odd)),
    )
    factors = find_factors(factor_table)
    discordant = np.bincount(factors.of_record, weights=odd, minlength=len(factors.cases))
    for case, found, repeats in zip(factors.cases, discordant, factors.repeats, strict=True):
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


def find_limitations(tree: xr.DataTree) -> list[str]:
    """Return where the data did not speak, and what its prior moves; nothing for a tree without `GROUP`.

    Of cells that the data do not determine `failed_checks` speaks.
    """
    if GROUP not in tree.children:
        return []
    figures = {str(name): each for name, each in tree[GROUP].to_dataset().data_vars.items()}
    said = {name: identified(tree, name).assign(element=_elements(each)) for name, each in figures.items()}
    asked = {name: table for name, table in said.items() if _parameter(name) in REMEDIES}
    hyperparameters = pd.concat([table for name, table in said.items() if name not in asked])
    return [*_silent(asked, hyperparameters), *_moved(pd.concat(asked.values()), hyperparameters)]


def _parameter(name: str) -> str:
    """Return the parameter that a quantity of a case, a record or their mean is of."""
    return name.removesuffix("_case").removesuffix("_mean").removesuffix("_group")


def _elements(figures: xr.DataArray) -> list[str]:
    dims = [dim for dim in figures.dims if dim != "measure"]
    if not dims:
        return [str(figures.name)]
    return [f"{figures.name}[{label}]" for label in figures[dims[0]].to_numpy()]


def _listed(elements: pd.Series) -> str:
    more = f" and {len(elements) - _NAMED} more" if len(elements) > _NAMED else ""
    return ", ".join(elements[:_NAMED]) + more


def _silent(asked: dict[str, pd.DataFrame], hyperparameters: pd.DataFrame) -> Iterator[str]:
    for name, table in asked.items():
        silent = table[table["contraction"] < CONTRACTION_LEAST]
        if len(silent) and not name.endswith("_group"):
            least = silent["contraction"].min()
            yield (
                f"{_listed(silent['element'])}: the data did not speak: contraction {least:.3f} (below "
                f"{CONTRACTION_LEAST}), the posterior is little more than the prior; {REMEDIES[_parameter(name)]}"
            )
    silent = hyperparameters[hyperparameters["contraction"] < CONTRACTION_LEAST]
    if len(silent):
        yield (
            f"{_listed(silent['element'])}: the data hardly spoke: contraction {silent['contraction'].min():.3f} "
            f"(below {CONTRACTION_LEAST}); measure more cases or levels if the populations matter"
        )


def _moved(asked: pd.DataFrame, hyperparameters: pd.DataFrame) -> Iterator[str]:
    for table, remedy in (
        (asked, "say so where you quote them, and measure more repeats or cases"),
        (hyperparameters, "measure more cases or levels if the populations matter"),
    ):
        moved = table[table["decided_by"].isin(["prior", "both"])]
        moved = moved.sort_values("prior_sensitivity", ascending=False, kind="stable")
        if len(moved):
            yield (
                f"{_listed(moved['element'])}: the prior moves them: sensitivity up to "
                f"{moved['prior_sensitivity'].iloc[0]:.3f} (above {SENSITIVE}); {remedy}"
            )
