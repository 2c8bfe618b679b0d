"""Truths and records drawn from the priors, by the model itself run forwards.

So calibration checks that densities and sampler are those of the very program that drew the truths. That the program
is the model of the documentation is checked apart from it: the tests hold its draws and densities against others,
written in numpy alone.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, effect_scales
from bayes_tyre.inference.model.models import records_model
from bayes_tyre.inference.model.prior_predictive import draw_prior
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.laws.fancher import equation_2_offset
from bayes_tyre.studies.design import START_MM, Design

#: Priors of a calibration where they are not those of `PRIORS`: about truck tyres that a record can tell of. The wide
#: ones make, in every third data set, a record from which no method could tell beta (J near zero under coarse noise,
#: beta beyond the travel), and discordant repeats of wide scatter whose k is thousands of times off.
NARROWED: dict[str, Prior] = {
    "k_group": Prior(dist.LogNormal, (np.log(1.8), 0.3), "kN/mm", "1.0 to 3.2 kN/mm: truck tyres"),
    "beta_group": Prior(dist.LogNormal, (np.log(0.1), 0.5), "mm", "0.04 to 0.27 mm: spacing below, travel above"),
    "sd_log_k_repeat": Prior(dist.LogNormal, (np.log(0.05), 0.3), "", "2.7 to 9 %"),
    "sd_log_beta_repeat": Prior(dist.LogNormal, (np.log(0.10), 0.3), "", "5.5 to 18 %"),
    "sd_log_k_repeat_over_speeds": Prior(
        dist.HalfNormal, (0.3,), "", "rolling scatters up to twice as much as standing"
    ),
    "sd_log_beta_repeat_over_speeds": Prior(dist.HalfNormal, (0.3,), "", "as for k"),
    "sd_J": Prior(dist.LogNormal, (np.log(3.0), 0.3), "kN", "1.7 to 5.4 kN: an offset that noise does not hide"),
    "sigma_typical": Prior(dist.LogNormal, (np.log(0.006), 0.4), "kN", "0.003 to 0.013 kN: a good load cell"),
    "sd_log_sigma": Prior(dist.HalfNormal, (0.4,), "", "noise differs by a factor of two among records"),
}

#: Of weak records: about 0.3 kN of a step of 10 kN, with `WEAK_POINTS` points.
COARSE = Prior(dist.LogNormal, (np.log(0.3), 0.4), "kN", "0.14 to 0.65 kN: coarse")

#: Truths by name of the site, shape (sets, ...).
Truths = dict[str, np.ndarray]


class Planted(NamedTuple):
    """Factors by which truths are made to differ from what the model holds; 1: not at all.

    Attributes
    ----------
    scatter:
        On the scatter of repeats about their case.
    scales:
        On the standard deviations of the effects of factors.
    noise:
        On the noise of every point.
    """

    scatter: float = 1.0
    scales: float = 1.0
    noise: float = 1.0


NOTHING = Planted()


def draw_truths(
    design: Design, sets: int, seed: int, priors: Priors, planted: Planted = NOTHING, noise: str = "iid"
) -> tuple[Truths, Float[np.ndarray, "sets records points"]]:
    """Return `sets` independent draws of all that the model of a design's records holds, by name, and their forces.

    Parameters of `planted` other than 1 make them truths of another model. `noise` is ``iid``, ``ar1`` or ``student``.
    """
    factors = design.factors
    scales = [name for parameter in PARAMETERS for name in effect_scales(parameter, factors)]
    widened = {
        name: priors[name]._replace(parameters=(planted.scales * priors[name].parameters[0],)) for name in scales
    }
    data = design.nominal(record_data(design.batch(np.zeros(design.u.shape))))
    arguments = {"data": data, "factors": factors, "priors": priors.changed(widened), "observed": False, "noise": noise}
    truths = draw_prior(records_model, arguments, [*QUANTITIES, "force"], sets, seed)
    of_points = truths.pop("force") - noiseless_forces(design, truths)
    for parameter in PARAMETERS:
        case = truths[f"{parameter}_case"][:, factors.of_record]
        truths[parameter] = case * (truths[parameter] / case) ** planted.scatter
    truths["C"] = truths["F_i"] + truths["J"] - truths["k"] * START_MM
    return truths, noiseless_forces(design, truths) + planted.noise * of_points


def noiseless_forces(design: Design, truths: Truths) -> Float[np.ndarray, "*sets records points"]:
    """Return forces (kN) by Equation 2."""
    F_i, J, k, beta = (truths[name][..., None] for name in ("F_i", "J", "k", "beta"))
    return F_i + np.asarray(equation_2_offset(design.u, k=k, J=J, beta=beta))


def simulate_forces(
    design: Design, truths: Truths, rng: np.random.Generator
) -> Float[np.ndarray, "sets records points"]:
    """Return forces (kN) by Equation 2, with normal noise on every point."""
    force = noiseless_forces(design, truths)
    return force + truths["sigma"][..., None] * rng.standard_normal(force.shape)


def study_priors(weak: bool = False) -> Priors:
    """Return every prior of a calibration: those of the model, some of them narrowed; of weak records, coarse noise."""
    return PRIORS.changed(NARROWED | ({"sigma_typical": COARSE} if weak else {}))
