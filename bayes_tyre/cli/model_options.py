"""The model of `fit` as options: which points and factors it uses, how repeats scatter, what the noise is like."""

from pathlib import Path
from typing import Annotated, Literal

import typer

RegionOption = Annotated[
    Literal["all", "thesis"], typer.Option(help="all points of each record; or the thesis's first 70 %.")
]
InitialLoadOption = Annotated[
    Literal["nominal", "actual"],
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
DisplacementSdOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="MM",
        help="Standard deviation (mm) of the error of a displacement, which counts near the start of a step; default: "
        "that of rounding, where a record's displacements are multiples of its converter's step, else 0.",
    ),
]
LikelihoodOption = Annotated[
    Literal["compressed", "direct"],
    typer.Option(help="compressed, whatever the number of points; or direct, point by point."),
]
SamplerOption = Annotated[
    Literal["collapsed", "joint"],
    typer.Option(
        help="collapsed: 100 records or more are integrated out by summaries of them, where these are good enough; or "
        "joint: records are sampled with what they share."
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
    Literal["auto", "iid", "ar1"],
    typer.Option(
        help="auto: each point's noise follows the one before by as much as the records say, and may be larger or "
        "smaller near the start; ar1: the former alone; iid: independent from point to point."
    ),
]
NoiseWindowOption = Annotated[
    int, typer.Option(min=1, help="Samples of the moving average that went over the noise alone; 1: none.")
]
PriorsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.toml",
        help="Own priors: a line a quantity, such as k_group = { median = 1.8, sd_log = 0.3 } (kN/mm), and "
        "discordant_widening = 6, apart_widening = 5, apart_weight = 0.05.",
    ),
]
