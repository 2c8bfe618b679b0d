"""Quantities of the posterior in the user's terms: ``stiffness k of dual`` for ``k_group[dual]``."""

import re

from bayes_tyre.record import AXLE_PARAMETERS, ENERGY, LAW_PARAMETERS
from bayes_tyre.report.wording import AXIS_NAMES

_PARAMETERS = (*LAW_PARAMETERS, *AXLE_PARAMETERS, ENERGY, "J", "C", "F_i", "sigma", "rho")
_NAMES = {
    **AXIS_NAMES,
    **{"sigma": "noise sigma", "J": "offset J", "C": "offset C", "F_i": "initial force F_i"},
    **{"rho": "correlation rho of the noise", "settled": "settled friction"},
}
#: What differs by a factor, its level with the unit, and what a standard deviation of the effect is over.
_LEVELS = {
    **{"speed": "{} km/h", "load": "initial load {} kN", "step": "step {} kN", "direction_step": "steps of {} kN"},
    **{"configuration_speed": "{} km/h", "configuration_load": "{} kN of initial load"},
    **{"specimen": "specimen {}", "day": "day {}", "covariate": "one standard deviation of {}"},
}
_OVER = {
    **{"speed": "between speeds", "load": "between initial loads", "step": "between steps"},
    **{"direction_step": "between steps of one direction", "case": "between cases", "repeat": "between repeats"},
    **{"configuration_speed": "between speeds of one configuration", "published": "of printed values"},
    **{"configuration_load": "between initial loads of one configuration"},
    **{"specimen": "between specimens", "day": "between days"},
    **{"repeat_over_speeds": "of repeats, over speeds", "published_over_speeds": "of printed values, over speeds"},
}
_BY_SPEED = {"repeat_by_speed": "between repeats", "published_by_speed": "of printed values"}
_SINGLE = {
    "discordant_weight": "share of discordant repeats",
    "student_nu": "degrees of freedom of the repeats",
    "sd_log_sigma": "standard deviation of log sigma between records",
    "sigma_typical": "typical noise sigma",
    "noise_nu": "degrees of freedom of the noise",
    "sd_J": "standard deviation of J between records",
    "atanh_rho_typical": "typical correlation rho of the noise",
    "sd_atanh_rho": "standard deviation of the correlation rho between records",
    "displacement_scale": "common factor of the displacements",
    "force_scale": "common factor of the forces",
}
#: Between what failed and the error's message (`bayes_tyre.inference.diagnostics.attempts`).
_FAILED = " failed: "
#: A name and, in brackets, its element: a label may hold brackets itself.
_ELEMENT = re.compile(r"\b(?P<name>[A-Za-z]\w*)(?:\[(?P<label>(?:[^\[\]]|\[[^\[\]]*\])*)\])?")
_LEVEL = re.compile(rf"(?P<sd>sd_)?log_(?P<parameter>{'|'.join(_PARAMETERS)})_(?P<factor>\w+)")


def in_words(sentence: str) -> str:
    """Return a sentence of `diagnostics.json` with its quantities in the user's terms; what is no quantity stays.

    So does the message of an error of this package, which is looked for by its text.

    Examples
    --------
    >>> in_words("k_group[dual loading], sd_log_beta_speed: weakly identified")
    'stiffness k of dual loading, standard deviation of log beta between speeds: weakly identified'
    """
    if _FAILED in sentence:
        return sentence
    return _ELEMENT.sub(lambda match: _words(match["name"], match["label"]) or match[0], sentence)


def _words(name: str, label: str | None) -> str:
    """Return a quantity in words; nothing for a word that is none."""
    if name in _SINGLE:
        return _SINGLE[name]
    if name == "J_group":
        return f"mean of J of {label}" if label else "means of J"
    if (level := _LEVEL.fullmatch(name)) is not None:
        return _of_level(level["parameter"], level["factor"], bool(level["sd"]), label)
    parameter = re.sub(r"_(case|group|mean)$", "", name)
    of_parameter = _NAMES.get(parameter, parameter) if parameter in _PARAMETERS else ""
    if label is None:
        return f"{of_parameter} of cases" if name.endswith("_case") and of_parameter else ""
    if parameter == "outlier_probability":
        return f"outlier probability of {label}"
    if (apart := parameter.removesuffix("_apart_probability")) != parameter:
        return f"probability that {apart} of {label} stands apart from other cases"
    return f"{of_parameter} of {label}" if of_parameter else ""


def _of_level(parameter: str, factor: str, is_sd: bool, label: str | None) -> str:
    if is_sd and factor in _BY_SPEED and label is not None:
        return f"standard deviation of log {parameter} {_BY_SPEED[factor]} at {label} km/h"
    if is_sd:
        return f"standard deviation of log {parameter} {_OVER[factor]}" if factor in _OVER else ""
    if factor not in _LEVELS or label is None:
        return ""
    return f"effect of {_LEVELS[factor].format(label)} on {_NAMES.get(parameter, parameter)}"
