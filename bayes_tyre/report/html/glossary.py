"""What the document's terms mean: a short glossary, with units."""

from collections.abc import Sequence

from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.answer.losses import LOSSES

PARAMETERS = {
    "k": ("k, kN/mm", "Stiffness: force gained a millimetre of deflection, once the friction has been overcome."),
    "beta": (
        "beta, mm",
        "Characteristic deflection: how far the tyre must move before its force follows the line of k.",
    ),
    "J": ("J, kN", "Offset of that line at the start of the step: the friction a step has to overcome first."),
    "C": ("C, kN", "Force of that line at zero displacement."),
    "x": ("x, kN", "Friction: half the distance between the lines of loading and unloading."),
    "settled": ("settled, kN", "Friction on which the force settles when a tyre is moved on."),
    "n": ("n", "How suddenly the force settles: 1 for Fancher's law."),
    "belt_frequency": ("belt_frequency, Hz", "Undamped natural frequency of the belt, with the rim held."),
    "belt_damping": ("belt_damping", "Damping ratio of the belt's swing."),
    "sidewall_ratio": ("sidewall_ratio", "Stiffness of the sidewall over the stiffness between belt and road."),
    "m": ("m, kg", "Mass that moves with the wheel centre."),
    "c": ("c", "Viscous damping, in the unit that its column states."),
    "energy_per_cycle": ("Energy a cycle, J", "Energy lost in a cycle of loading and unloading, at the wheel centre."),
    "loss factor": (
        "Loss factor",
        "Energy lost in a cycle over 2 pi times the energy stored at its end, at the stated amplitude; a pure number.",
    ),
    "equivalent damping": (
        "Equivalent damping, kN s/mm",
        "Viscous damping that would lose as much in that cycle, at the natural frequency of the mass on the tyre.",
    ),
    "separation of branches": (
        "Separation of branches, kN",
        "2 (x - k beta): how far apart the force settles going up and coming down, on flat ground.",
    ),
    "stiffness of a slow cycle": (
        "Stiffness of a cycle, kN/mm",
        "Change of force over the stroke, slow, at 1 Hz or in free vibration, on flat ground. With friction it exceeds "
        "k, the more the smaller the cycle: what a law predicts of other tests than the step it was fitted to.",
    ),
    "sigma": (
        "sigma, kN",
        "Standard deviation of the noise of the force about the curve; with --noise student its scale, which is less.",
    ),
}
ALWAYS = {
    "Case, record, repeat": "A case is one test: configuration, direction, speed (km/h), initial load and step (kN). "
    "A record is one repeat of it.",
    "Interval": "Given data and model, the value lies in it with the stated probability, as likely below as above it. "
    "It holds no error that the model does not know, such as that of a gauge.",
    "Ratio, P(ratio > 1)": "One value divided by another, 1 where they are equal; and the probability that the "
    "first is larger: (count + 1/2) / (draws + 1), the count that of draws above 1. No number of draws shows that "
    "it is 0 or 1, so near these a bound is stated.",
    "Matched by": "same case: two configurations in the same test. same span: the same two loads in opposite "
    "directions, such as 20-30 against 30-20 kN. same initial load: such as 20-30 against 20-10 kN. pooled as "
    "published: means over unlike cases, as the source compares them.",
    "Outlier probability": "How probable it is that a repeat does not agree with the others of its case. Such a record "
    "counts for less; none is dropped. Empty where fewer than three repeats leave nothing to judge by; no column where "
    "the model does not ask (--repeats student or normal).",
    "Prior": "Distribution of a quantity before any data. Where the data determine little, the posterior is near it.",
    "Verdict": "pass: R-hat at most 1.01 (chains agree), enough effective draws (ESS), a Monte Carlo error of at most "
    "0.02 in outlier probabilities, no divergence, and nothing in the records that contradicts the model. fail: at "
    "least one of these is not so, and the reasons say which.",
}


def glossary(results: Sequence[Reported]) -> dict[str, str]:
    """Return what the terms of the results mean: the parameters that they have, and what all have."""
    shown = {parameter for result in results for parameter in result.parameters}
    shown |= {name for result in results if result.of_motions for name in LOSSES.values()}
    return {name: text for parameter, (name, text) in PARAMETERS.items() if parameter in shown} | ALWAYS
