"""How to fit motions: what `motion`'s options say."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record import DISPLACEMENT_SCALE_SD, FORCE_SCALE_SD
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.workflow.fit import sampler_options

#: By the name of the option: how well a rig's file says that the factor is known.
SCALES: Mapping[str, Callable[[Rig], float]] = {
    DISPLACEMENT_SCALE_SD: geometry.displacement_relative_sd,
    FORCE_SCALE_SD: geometry.force_relative_sd,
}


@dataclass(frozen=True)
class MotionPlan:
    """How to fit motions.

    Attributes
    ----------
    sampler:
        How much to sample.
    rig, cases, figures:
        Name or TOML file of the rig (None: the configuration's own), table of cases, folder of a figure a record.
    law:
        Name of the force law.
    amplitude_mm:
        Half the stroke at the wheel centre of the cycle whose losses are reported.
    repeats:
        How repeats scatter about their case.
    interval:
        Probability of every interval, equal-tailed.
    priors:
        Of the hierarchy.
    limit:
        What `cases.csv` says the probability of, such as ``k >= 1.8``; None: nothing.
    displacement_scale_sd, force_scale_sd:
        Relative standard deviations of common factors on displacement and acceleration (carried into k, beta, m, c and
        the energy) and on force (k, x, m, c and the energy); 0: none; None: that of the least accurate rig.
    """

    sampler: SamplerSettings
    rig: str | None = None
    cases: Path | None = None
    figures: Path | None = None
    law: str = "fancher"
    amplitude_mm: float = 1.0
    repeats: str = "mixture"
    interval: float = 0.95
    priors: Priors = PRIORS
    limit: str | None = None
    displacement_scale_sd: float | None = None
    force_scale_sd: float | None = None

    def __post_init__(self) -> None:
        for name in SCALES:
            if (sd := getattr(self, name)) is not None and not 0.0 <= sd < math.inf:
                raise BadInput(f"{name} is {sd:g}; give 0 or more, such as 0.01")

    @property
    def options(self) -> dict[str, object]:
        """What `run.json` says of it, beside the seed and the inputs; limit and factors only where they were given."""
        sources = {"rig": self.rig, "cases": None if self.cases is None else str(self.cases), "law": self.law}
        return {
            **sampler_options(self.sampler),
            **sources,
            "priors": self.priors.given(),
            **{"amplitude_mm": self.amplitude_mm, "repeats": self.repeats, "interval": self.interval},
            **({} if self.limit is None else {"limit": self.limit}),
            **{name: sd for name in SCALES if (sd := getattr(self, name))},
        }

    def with_scales_of(self, rigs: Sequence[Rig]) -> "MotionPlan":
        """Return the plan with how well factors are known where it does not say: those of the least accurate rig."""
        largest = {name: max(map(sd_of, rigs), default=0.0) for name, sd_of in SCALES.items()}
        return replace(self, **{name: sd for name, sd in largest.items() if getattr(self, name) is None})

    @property
    def input_files(self) -> list[Path]:
        """The files that options name: the table of cases, and the rig where it is a file."""
        named = [self.cases, Path(self.rig) if self.rig is not None else None]
        return [path for path in named if path is not None and path.is_file()]
