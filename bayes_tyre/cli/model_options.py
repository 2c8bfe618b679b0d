"""The model of `fit` as options: which points and factors it uses, how repeats scatter, what the noise is like."""

from pathlib import Path
from typing import Annotated, Literal

import typer

#: Force laws that a motion can be fitted with: Fancher's, those that extend it and their average; and all of them, with
#: the average over a campaign.
FancherLaw = Literal["fancher", "relaxing", "speed_friction", "stiffening", "two_yields", "auto"]
MotionLaw = Literal["fancher", "kelvin_voigt", "bouc_wen", "maxwell_slip", "rigid_ring", FancherLaw, "auto_campaign"]
RegionOption = Annotated[
    Literal["all", "thesis"],
    typer.Option(help="all: all points of each record; thesis: its first 70 %, as in the source."),
]
InitialLoadOption = Annotated[
    Literal["nominal", "actual"],
    typer.Option(
        help="How k and beta depend on the initial load: an effect of each nominal initial_load_kN, or a slope over "
        "the force (kN) at which a case's records really started."
    ),
]
DisplacementScaleOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        max=1.0,
        help="Relative standard deviation of a common, unknown factor on displacement (0.05: a gauge accurate to 5 %), "
        "of motions on acceleration too (a lever arm); it widens the intervals of k and beta, not those of their "
        "ratios. Default: what [accuracy] of the rig file says (in a record table the column displacement_scale_sd), "
        "or 0.",
        show_default=False,
    ),
]
ForceScaleOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        max=1.0,
        help="Relative standard deviation of a common, unknown factor on force (0.01: load cell and lever arms are "
        "known to 1 %); it widens the intervals of k and of forces, not those of ratios or of beta. Default: what "
        "[accuracy] of the rig file says (in a record table the column force_scale_sd), or 0.",
        show_default=False,
    ),
]
DisplacementSdOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="MM",
        help="Standard deviation (mm) of the noise of a displacement, which counts near the start of a step; default: "
        "what the records show, of noise or of a converter's steps; 0: none.",
    ),
]
LikelihoodOption = Annotated[
    Literal["compressed", "direct"],
    typer.Option(
        help="compressed: by sums over the points of a record; direct: point by point, slower, the same posterior."
    ),
]
SamplerOption = Annotated[
    Literal["collapsed", "joint"],
    typer.Option(
        help="collapsed: 100 records or more are integrated out by summaries of them, where these are accurate enough; "
        "joint: the parameters of all records are sampled too, slower, the same posterior."
    ),
]
LawOption = Annotated[
    Literal["equation_2", "small_step_limit"],
    typer.Option(
        help="Force law of the records: Equation 2, or the limit of Equation 1 for small steps, F_i + J (1 - "
        "exp(-|u|/beta)) + k u."
    ),
]
RepeatsOption = Annotated[
    Literal["mixture", "student", "normal"],
    typer.Option(help="How repeats scatter: usual and discordant ones, Student-t, or normal."),
]
NoiseOption = Annotated[
    Literal["auto", "iid", "ar1", "student"],
    typer.Option(
        help="Noise of the force. auto: correlated from point to point by as much as the records show, and larger or "
        "smaller near the start of a step; ar1: the correlation alone; iid: independent from point to point; student: "
        "that with heavy tails, for exact displacements (--displacement-sd 0 where they are in steps of a converter)."
    ),
]
NoiseWindowOption = Annotated[
    int, typer.Option(min=1, help="Length (samples) of a moving average that was applied to the noise alone; 1: none.")
]
SpecimenOption = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMN",
        help="Column that says which tyre of its configuration a record was made on: k and beta then differ from tyre "
        "to tyre, and intervals are those of the type of tyre.",
    ),
]
DayOption = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMN",
        help="Column that says on which day, or after which mounting, a record was made: what its records share is "
        "then no difference between cases.",
    ),
]
CovariateOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="COLUMN",
        help="Column of numbers, such as a pressure or a temperature, that k and beta may change with; cases are given "
        "at its mean. May be repeated.",
    ),
]
PriorsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.toml",
        help="Own priors: a line a quantity, such as k_group = { median = 1.8, sd_log = 0.3 } (kN/mm), and "
        "discordant_widening = 6, apart_widening = 5, apart_weight = 0.05.",
    ),
]
