"""Settings of fits of simulated records that several files make: where these are one, so is what is compiled."""

import pandas as pd
import xarray as xr
from helpers.simulated_records import Plan

from bayes_tyre.inference.sampling.run import SamplerSettings

#: Of 48 records in 16 cases. A thousand draws tell where 2.5 % lie. The length of the warmup, the number of chains and
#: the acceptance are part of what is compiled, points of a record are not; a stated acceptance keeps a run with a
#: divergence from being repeated.
SHORT = SamplerSettings(chains=2, warmup=350, draws=500, seed=1, target_accept=0.65)

#: 24 records in 8 cases, and the sampler of their fits: the warmup of the refits of `compare`, whose shapes are theirs.
STANDING = Plan(configurations=("single", "dual"), speeds=(0.0,), points=40)
OF_STANDING = SamplerSettings(chains=2, warmup=400, draws=300, seed=1, target_accept=0.65)


def covered(tree: xr.DataTree, truth: pd.DataFrame) -> int:
    """Return in how many records the 95 % intervals of k and beta hold the truth, both counted."""
    posterior, hits = tree["posterior"].to_dataset(), 0
    for name in ("k", "beta"):
        lower, upper = posterior[name].quantile([0.025, 0.975], ("chain", "draw")).to_numpy()
        hits += int(((lower <= truth[name].to_numpy()) & (truth[name].to_numpy() <= upper)).sum())
    return hits
