"""Whether records that are called discordant with some probability are so in that share of cases."""

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float
from scipy.stats import binom

from bayes_tyre.studies.ranked_quantities import Hierarchy, discordance_probability
from bayes_tyre.studies.truths import Truths
from bayes_tyre.studies.uniformity import TOGETHER

#: Limits of the probabilities that are counted together: most records are near 0.
EDGES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.3, 0.7, 0.95, 1.0)


def draw_discordant(hierarchy: Hierarchy, truths: Truths, rng: np.random.Generator) -> Bool[np.ndarray, "sets records"]:
    """Return which records of true values are discordant.

    The choice made when the values were drawn is not kept. It bears on the record's own values alone, so that one drawn
    given these is jointly distributed with everything else as that was.
    """
    probability = discordance_probability(hierarchy, truths)
    return rng.random(probability.shape) < probability


def outlier_calibration(
    predicted: Float[np.ndarray, "sets records"], discordant: Bool[np.ndarray, "sets records"]
) -> pd.DataFrame:
    """Return how many records were discordant among those with about the same `outlier_probability`.

    Parameters
    ----------
    predicted:
        Posterior mean of the probability that each record is discordant.
    discordant:
        Whether it is.

    Returns
    -------
    pandas.DataFrame
        `from, to` (probability), `records`, `predicted` (its mean), `discordant` (share), `lower, upper`: where shares
        of so many independent records lie, all rows together with a probability of 95 %; `inside`. Records of one data
        set are not quite independent, so that some more lie outside. Without a record, no row.
    """
    place = np.clip(np.digitize(predicted, EDGES) - 1, 0, len(EDGES) - 2)
    outside = (1.0 - TOGETHER) / (len(EDGES) - 1)
    rows = []
    for number in np.unique(place):
        here = place == number
        count, mean, share = int(here.sum()), float(predicted[here].mean()), float(discordant[here].mean())
        lower, upper = (float(binom.ppf(tail, count, mean)) / count for tail in (outside / 2.0, 1.0 - outside / 2.0))
        row = {"from": EDGES[number], "to": EDGES[number + 1], "records": count, "predicted": mean}
        rows.append(row | {"discordant": share, "lower": lower, "upper": upper, "inside": lower <= share <= upper})
    return pd.DataFrame(rows, columns=["from", "to", "records", "predicted", "discordant", "lower", "upper", "inside"])
