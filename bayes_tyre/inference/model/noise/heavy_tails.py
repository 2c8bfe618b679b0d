"""Noise with heavy tails: how much each point of a record counts, by how far it is off the record's curve.

Student-t noise is normal noise whose variance differs from point to point by a factor of unknown size. Given how far a
point is off, the mean of one over that factor is its weight: least squares with these weights have the residuals of a
normal, whose mean square is the square of the t's scale.

Source: Lange, Little and Taylor (1989), "Robust statistical modeling using the t distribution".
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from bayes_tyre.batch import Batch
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import UnequalNoise
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.noise.displacement_errors import DisplacementErrors
from bayes_tyre.inference.record_data import force_curves, record_data
from bayes_tyre.record import FORCE_PER_KG, MASS_SD

#: Degrees of freedom of estimates that know none better, as the source suggests.
USUAL_NU = 4.0
#: Estimates, each with the weights of the one before.
_FITS = 5


def heavy_tails(
    residual_kN: Float[np.ndarray, "records points"],
    present: Bool[np.ndarray, "records points"],
    sigma_kN: Float[np.ndarray, " records"],
    nu: float = USUAL_NU,
) -> UnequalNoise:
    """Return the whitening of Student-t noise about a curve: points that are far off it count less.

    Parameters
    ----------
    residual_kN, present:
        Measured less curve; 0 and False on padding.
    sigma_kN, nu:
        Scale and degrees of freedom of the noise.
    """
    square = (residual_kN / sigma_kN[:, None]) ** 2
    weight = np.where(present, (nu + 1.0) / (nu + square), 1.0)
    return UnequalNoise(jnp.asarray(np.sqrt(weight)))


def estimated_heavy_tails(batch: Batch, law: str, nu: float = USUAL_NU) -> UnequalNoise:
    """Return the whitening of records whose noise has heavy tails, about estimates that such tails hardly move."""
    whitening = UnequalNoise(jnp.ones(batch.present.shape))
    for _ in range(_FITS):
        estimates = estimate_records(batch, whitening=whitening, law=law)
        curve = np.asarray(force_curves(record_data(batch).u, estimates.centre, law))
        residual = np.where(batch.present, batch.force_kN - curve, 0.0)
        whitening = heavy_tails(residual, batch.present, np.exp(np.asarray(estimates.log_sigma)), nu)
    return whitening


def check_independent(batch: Batch, errors: DisplacementErrors) -> None:
    """Refuse records with errors beside independent noise of the force.

    Raises
    ------
    BadInput
        For displacements in steps, and for an error that the points of a record share.
    """
    if errors.sd_mm.any():
        raise BadInput(
            "displacements are in steps of a converter, whose errors noise student is not modelled with; give "
            "displacement_sd 0 to take them as exact, or noise auto"
        )
    if batch.force_error_kN is not None and batch.force_error_kN.any():
        raise BadInput(
            f"columns {FORCE_PER_KG} and {MASS_SD}: errors that points share are not modelled with noise student; "
            "remove the columns, or give noise auto"
        )
