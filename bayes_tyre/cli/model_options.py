"""The model of `fit` as options: which points and words it uses, how repeats scatter, what the noise is like."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Region(StrEnum):
    """Which points of a record are used."""

    all = "all"
    thesis = "thesis"


class InitialLoad(StrEnum):
    """What stands for the load in the model of the cases."""

    nominal = "nominal"
    actual = "actual"


class Likelihood(StrEnum):
    """How the density of a record's forces is computed."""

    compressed = "compressed"
    direct = "direct"


class Repeats(StrEnum):
    """How the repeats of a case scatter about it."""

    mixture = "mixture"
    student = "student"
    normal = "normal"


class Noise(StrEnum):
    """What the noise of a record is like."""

    iid = "iid"
    ar1 = "ar1"


RegionOption = Annotated[Region, typer.Option(help="all points of each record; or the thesis's first 70 %.")]
InitialLoadOption = Annotated[
    InitialLoad,
    typer.Option(
        help="What k and beta may change with: each nominal initial_load_kN, or a slope over the force (kN) that a "
        "case's records really started from."
    ),
]
DisplacementScaleOption = Annotated[
    float,
    typer.Option(
        min=0.0,
        max=1.0,
        help="Relative sd of a common, unknown factor on displacement (0.05: a gauge good to 5 %); it widens k and "
        "beta and no ratio of two.",
    ),
]
LikelihoodOption = Annotated[
    Likelihood, typer.Option(help="compressed, whatever the number of points; or direct, point by point.")
]
RepeatsOption = Annotated[
    Repeats, typer.Option(help="How repeats scatter: usual and discordant ones, Student-t, or normal.")
]
NoiseOption = Annotated[
    Noise, typer.Option(help="Independent from point to point; or ar1: each point's follows the one before.")
]
NoiseWindowOption = Annotated[
    int, typer.Option(min=1, help="Samples of the moving average that went over the noise alone; 1: none.")
]
PriorsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.toml",
        help="Own priors: a line a quantity, such as k_group = { median = 1.8, sd_log = 0.3 } (kN/mm), and "
        "discordant_widening = 6.",
    ),
]
