"""The effect of a level that was not tested, such as another speed, from those of the levels that were.

The fit takes the levels of a factor as exchangeable. Whether a value between two of them may be read off a smooth
curve, their effects say: with probability one half there is no trend, otherwise a Gaussian process of the factor, of
one of `LENGTHS`, with the standard deviation that the fit learnt for the effects. Near the levels tested it follows
them, far from them it knows no more than that standard deviation.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), chapter 2.
"""

import numpy as np
from jaxtyping import Float
from scipy.linalg import helmert

#: Lengths over which a trend bends, in spans of the levels tested.
LENGTHS = (0.5, 1.0)
#: Share of the variance that a level has for itself, beside the trend. With less, levels that have none and look smooth
#: by chance, as four often do, would be trusted too far.
OWN = 0.2


def effects_by_trend(
    tested: Float[np.ndarray, " levels"],
    effects: Float[np.ndarray, "draws levels"],
    new: Float[np.ndarray, " new"],
    sd: Float[np.ndarray, " draws"],
    rng: np.random.Generator,
) -> Float[np.ndarray, "draws new"]:
    """Return draws of the effects of levels that were not tested.

    Parameters
    ----------
    tested, effects:
        The levels tested, and draws of their effects, which sum to zero in each draw.
    new:
        The levels asked for.
    sd:
        Draws of the standard deviation of the effects.
    rng:
        Draws for each draw whether there is a trend and its length, by how probable they make the effects tested, and
        the effects asked for given these.
    """
    coordinates = (effects @ helmert(len(tested)).T) / sd[:, None]
    levels, covariances = np.concatenate([tested, new]), [np.eye(len(tested) + len(new))]
    if len(tested) > 2:  # two levels say nothing of how a curve between them bends
        covariances += [_of_trend(levels, len(tested), length) for length in LENGTHS]
    given = [_given_tested(covariance, coordinates) for covariance in covariances]
    log_densities, means, roots = map(np.stack, zip(*given, strict=True))
    log_densities[0] += np.log(max(1, len(covariances) - 1))
    chosen = np.argmax(log_densities + rng.gumbel(size=log_densities.shape), axis=0)
    errors = np.einsum("dnm,dm->dn", roots[chosen], rng.standard_normal((len(sd), len(new))))
    return sd[:, None] * (means[chosen, np.arange(len(sd))] + errors)


def _of_trend(levels: Float[np.ndarray, " levels"], tested: int, length: float) -> Float[np.ndarray, "levels levels"]:
    """Return the covariance of effects along a trend, for a mean variance of 1 about the mean of those tested."""
    apart = (levels[:, None] - levels) / (length * np.ptp(levels[:tested]))
    covariance = OWN * np.eye(len(levels)) + (1.0 - OWN) * np.exp(-0.5 * apart**2)
    contrasts = helmert(tested)
    return covariance / np.mean(np.diag(contrasts @ covariance[:tested, :tested] @ contrasts.T))


def _given_tested(
    covariance: Float[np.ndarray, "levels levels"], coordinates: Float[np.ndarray, "draws contrasts"]
) -> tuple[Float[np.ndarray, " draws"], Float[np.ndarray, "draws new"], Float[np.ndarray, "new new"]]:
    """Return log density of the effects tested, mean of the others given these, and the root of their covariance.

    Effects are counted from the mean of the levels tested, the first ones, and these are known by their contrasts.
    """
    tested = coordinates.shape[1] + 1
    of_tested, of_new = np.split(np.eye(len(covariance)), [tested])
    contrasts, from_mean = helmert(tested) @ of_tested, of_new - of_tested.mean(axis=0)
    of_contrasts = contrasts @ covariance @ contrasts.T
    gain = np.linalg.solve(of_contrasts, contrasts @ covariance @ from_mean.T).T
    conditional = from_mean @ covariance @ from_mean.T - gain @ of_contrasts @ gain.T
    square = np.sum(coordinates * np.linalg.solve(of_contrasts, coordinates.T).T, axis=1)
    log_density = -0.5 * (square + np.linalg.slogdet(of_contrasts)[1])
    return log_density, coordinates @ gain.T, np.linalg.cholesky(conditional)
