"""Every prior of the hierarchical models, as data: what it allows, and why it is that wide.

One has no place in the table, for it takes its scale from each record: F_i is normal about the first force, with the
record's change of force as its standard deviation. That is wider than any error of a first sample.
"""

from typing import NamedTuple

import jax
import numpy as np
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind


class Prior(NamedTuple):
    """One prior.

    Attributes
    ----------
    family:
        The NumPyro distribution; LogNormal takes location and scale of the logarithm.
    parameters:
        Its arguments in order.
    unit:
        Unit of the quantity; empty for a pure number.
    reason:
        What it allows, and why this wide.
    """

    family: type[dist.Distribution]
    parameters: tuple[float, ...]
    unit: str
    reason: str

    def distribution(self) -> dist.Distribution:
        """Return the prior as a NumPyro distribution."""
        return self.family(*self.parameters)


#: A discordant repeat has the usual scatter widened this many times. At 4 % scatter of k that is a standard
#: deviation of 24 %: wide enough that a repeat 30 % off is at home there, narrow enough to compete with 3 sigma.
DISCORDANT_WIDENING = 6.0

#: By name of the site in `hierarchical`. Scales of k and beta are relative (of the logarithm).
PRIORS: dict[str, Prior] = {
    "k_cell": Prior(
        dist.LogNormal, (np.log(1.0), 1.0), "kN/mm", "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres"
    ),
    "beta_cell": Prior(
        dist.LogNormal, (np.log(0.1), 2.0), "mm", "0.002 to 5 mm: the source's betas to those of leaf springs"
    ),
    "log_k_speed_scale": Prior(dist.HalfNormal, (0.2,), "", "rolling changes k by tens of per cent at most"),
    "log_k_load_scale": Prior(dist.HalfNormal, (0.2,), "", "k grows by tens of per cent over the load range of a tyre"),
    "log_k_step_scale": Prior(dist.HalfNormal, (0.2,), "", "k is a slope: the size of the step should matter little"),
    "log_beta_speed_scale": Prior(dist.HalfNormal, (0.5,), "", "a factor of up to e between speeds"),
    "log_beta_load_scale": Prior(dist.HalfNormal, (0.5,), "", "a factor of up to e between loads"),
    "log_beta_step_scale": Prior(
        dist.HalfNormal, (1.0,), "", "Table 11: a factor of 4 to 8 between steps of 5 and 10 kN"
    ),
    "log_beta_direction_step_scale": Prior(
        dist.HalfNormal, (1.0,), "", "as for the step: Table 11 shows it in loading"
    ),
    "log_k_case_scale": Prior(dist.LogNormal, (np.log(0.08), 0.8), "", "1.6 to 38 %: what the words leave over"),
    "log_beta_case_scale": Prior(dist.LogNormal, (np.log(0.2), 0.8), "", "4 to 96 %: what the words leave over"),
    "log_k_repeat_scatter": Prior(dist.LogNormal, (np.log(0.06), 0.8), "", "1.2 to 29 %; Table 8 suggests 4 to 10 %"),
    "log_beta_repeat_scatter": Prior(
        dist.LogNormal, (np.log(0.12), 0.8), "", "2.5 to 58 %: beta is harder to repeat than k"
    ),
    "log_k_scatter_spread": Prior(dist.HalfNormal, (0.7,), "", "rolling may scatter several times as much as standing"),
    "log_beta_scatter_spread": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
    "discordant_weight": Prior(dist.Beta, (1.0, 19.0), "", "a mean of 5 %, below 15 % with 95 % probability"),
    "student_nu": Prior(dist.LogNormal, (np.log(8.0), 0.5), "", "3 to 21: tails from heavy to nearly normal"),
    "J_scale": Prior(dist.HalfNormal, (2.0,), "kN", "friction at the start of a step: up to a few kN"),
    "sigma_typical": Prior(
        dist.LogNormal, (np.log(0.03), 1.5), "kN", "0.0016 to 0.57 kN: a good cell to a coarse converter"
    ),
    "log_sigma_spread": Prior(dist.HalfNormal, (0.7,), "", "noise differs by a factor of a few among records"),
    "atanh_rho_typical": Prior(
        dist.Normal, (0.5, 1.0), "", "lag-1 autocorrelation of the noise of -0.9 to 0.986: white to slowly drifting"
    ),
    "atanh_rho_spread": Prior(dist.HalfNormal, (0.5,), "", "one chain of instruments: records differ little"),
    "published_scatter_k": Prior(
        dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: repeats, processing and case together"
    ),
    "published_scatter_beta": Prior(
        dist.LogNormal, (np.log(0.3), 0.8), "", "6 to 144 %: repeats, processing and case together"
    ),
}


def prior_medians() -> dict[str, np.ndarray]:
    """Return about the median of each prior, by site: of draws, since not every family has its quantiles."""
    key = jax.random.key(0)
    return {name: np.asarray(np.median(prior.distribution().sample(key, (999,)))) for name, prior in PRIORS.items()}
