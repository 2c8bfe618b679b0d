"""Options of the hierarchical model of records."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.settings import REGIONS
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.repeat_distribution import REPEATS
from bayes_tyre.inference.record_data import EQUATION_2, LAWS

INITIAL_LOADS = ("nominal", "actual")
LIKELIHOODS = ("compressed", "direct")
NOISE = ("auto", "iid", "ar1", "student")
SAMPLERS = ("collapsed", "joint")


@dataclass(frozen=True)
class ModelSettings:
    """Options of the hierarchical model of records.

    Attributes
    ----------
    region:
        ``all`` points of each record, or ``thesis``: the source's first 70 %.
    initial_load:
        What k and beta may change with: ``nominal``, an effect of each `initial_load_kN`, or ``actual``, a slope
        over the mean force that a case's records really started from.
    displacement_scale_sd:
        Relative standard deviation of a common factor on displacement, carried into k and beta; 0: none; None: what
        a column of this name says of the records.
    force_scale_sd:
        Likewise of a factor on force, carried into k, J, C and F_i.
    displacement_sd:
        Standard deviation of the error of a displacement, mm; None: of rounding to the converter's steps, in records
        whose displacements are multiples of one, or with noise ``auto`` what the records show of it.
    likelihood:
        ``compressed``: independent of the number of points; or ``direct``, point by point: the reference. Noise
        ``student`` is point by point with either.
    repeats:
        How repeats scatter about their case: a ``mixture`` of usual and discordant ones, ``student`` or ``normal``.
    noise:
        ``auto``: as ``ar1``, and as large near the start, and of the displacement, as the records show; ``ar1``: each
        point's follows the one before, by as much as the records say; ``iid``: independent from point to point; or
        ``student``: that with heavy tails, a Student-t whose degrees of freedom all records share.
    noise_window:
        Samples of the moving average that went over the noise, such as 801; 1: none. It says all of the noise.
    priors:
        Of the hyperparameters, and the constants of the mixtures of repeats and of cases.
    law:
        Force law of the records: ``equation_2``, or ``small_step_limit``, the limit of Equation 1 for small steps.
    specimen, day:
        Columns of the record table that say which specimen of its configuration a record was made on, and on which day
        or mounting: records that share one share an unknown deviation of k and beta. None: not modelled.
    covariates:
        Columns of numbers, such as a pressure, with a slope each of the logarithms of k and beta.
    sampler:
        ``collapsed``: records integrated out by summaries of them, wherever these are good enough; or ``joint``:
        records sampled beside what they share, the reference.

    Raises
    ------
    BadInput
        For unknown names, and a standard deviation that is negative or not finite.
    """

    region: str = "all"
    initial_load: str = "nominal"
    displacement_scale_sd: float | None = None
    likelihood: str = "compressed"
    repeats: str = "mixture"
    noise: str = "auto"
    noise_window: int = 1
    priors: Priors = PRIORS
    sampler: str = "collapsed"
    law: str = EQUATION_2
    displacement_sd: float | None = None
    specimen: str | None = None
    day: str | None = None
    covariates: Sequence[str] = ()
    force_scale_sd: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.priors, Priors):
            raise BadInput(
                "priors of ModelSettings are a Priors; give what you change to fit: fit(records, priors={...})"
            )
        if isinstance(self.covariates, str):
            raise BadInput(f"covariates are several columns; give [{self.covariates!r}]")
        # A list, as run.json has it, has no hash; and a column counts once.
        object.__setattr__(self, "covariates", tuple(dict.fromkeys(self.covariates)))
        for name, allowed in (
            *(("region", REGIONS), ("initial_load", INITIAL_LOADS), ("likelihood", LIKELIHOODS)),
            *(("repeats", REPEATS), ("noise", NOISE), ("sampler", SAMPLERS), ("law", tuple(LAWS))),
        ):
            if getattr(self, name) not in allowed:
                raise BadInput(f"{name} {getattr(self, name)!r} is unknown; use {' or '.join(allowed)}")
        for name in ("displacement_scale_sd", "force_scale_sd"):
            if (sd := getattr(self, name)) is not None and not 0 <= sd < np.inf:
                raise BadInput(f"{name} is {sd}; give 0 or a relative sd such as 0.05")
        if self.displacement_sd is not None and not 0 <= self.displacement_sd < np.inf:
            raise BadInput(f"displacement_sd is {self.displacement_sd}; give mm, such as 0.01, or 0 for none")
        if self.noise_window > 1 and self.displacement_sd:
            raise BadInput(f"noise_window {self.noise_window} says all of the noise; give it without displacement_sd")
        if self.noise_window < 1:
            raise BadInput(f"noise_window is {self.noise_window}; give the samples averaged, or 1 for none")
        if self.noise == "student" and self.displacement_sd:
            raise BadInput("noise student takes displacements as exact; give it without displacement_sd")
        if self.noise_window > 1 and self.noise in ("ar1", "student"):
            raise BadInput(
                f"noise_window {self.noise_window} says all of the noise; give it without noise {self.noise}"
            )

    @property
    def correlation(self) -> str:
        """What the noise of a point is beside that of others: ``iid``, ``ar1`` or ``student``."""
        if self.noise == "auto":
            return "iid" if self.noise_window > 1 else "ar1"
        return self.noise

    @property
    def uneven(self) -> bool:
        """Whether the noise may differ near the start of a record."""
        return self.noise == "auto" and self.noise_window == 1
