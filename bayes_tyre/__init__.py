"""Bayesian parameter identification for the stiffness and hysteresis of tyres.

The names below carry a whole analysis and are loaded when first used, so that importing the package, or asking a
command for help, waits for no library; `bayes_tyre.analysis` says what each does. Everything else is imported from the
module it stands in.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayes_tyre.analysis import (
        BadInput,
        FitSettings,
        ModelSettings,
        SamplerSettings,
        cases,
        contrasts,
        diagnose,
        equation_2,
        figure,
        fit,
        fit_least_squares,
        fit_published,
        predict,
        read_posterior,
        read_records,
        reconstruct_campaign,
        repeats,
        with_log_likelihood,
    )

__all__ = [
    "BadInput",
    "FitSettings",
    "ModelSettings",
    "SamplerSettings",
    "cases",
    "contrasts",
    "diagnose",
    "equation_2",
    "figure",
    "fit",
    "fit_least_squares",
    "fit_published",
    "predict",
    "read_posterior",
    "read_records",
    "reconstruct_campaign",
    "repeats",
    "with_log_likelihood",
]


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module("bayes_tyre.analysis"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
