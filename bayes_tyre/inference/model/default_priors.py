"""The priors of the hierarchical models unless the user gives others: what each allows, and why it is that wide.

One has no place in the table, for it takes its scale from each record: F_i is normal about the first force, with the
record's change of force as its standard deviation. That is wider than any error of a first sample.
"""

import numpy as np
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind

from bayes_tyre.inference.model.priors import Prior, Priors

#: A discordant repeat has the usual scatter widened this many times. At 4 % scatter of k that is a standard
#: deviation of 24 %: wide enough that a repeat 30 % off is at home there, narrow enough to compete with 3 sigma.
DISCORDANT_WIDENING = 6.0

#: A case that stands apart has the usual remainder widened this many times. At a remainder of 5 % of k that is a
#: standard deviation of 25 %: wide enough that a case 30 % off the others is at home there, as single ones of the
#: source are, narrow enough to compete with 3 sigma.
APART_WIDENING = 5.0
#: Share of the cases that stand apart: one of 20, as of discordant repeats. It is no unknown, for dozens of cases hold
#: almost nothing of a share that small.
APART_WEIGHT = 0.05


def _log_normal(median: float, sd_log: float, reason: str, unit: str = "") -> Prior:
    return Prior(dist.LogNormal, (np.log(median), sd_log), unit, reason)


def _half_normal(scale: float, reason: str, unit: str = "") -> Prior:
    return Prior(dist.HalfNormal, (scale,), unit, reason)


#: By name of the site in `models.py` and `motion/hierarchy/model.py`. Standard deviations of k, beta, ... are those of
#: the logarithm. `settled` is x - k beta. The prior of the mass covers any axle: the rig file's own mass, with which
#: each record is fitted, would otherwise count once for every record.
PRIORS = Priors(
    {
        "k_group": _log_normal(1.0, 1.0, "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres", "kN/mm"),
        "beta_group": _log_normal(
            0.1, 2.0, "0.002 to 5 mm: the smallest step that a laser resolves to the slip of leaf springs", "mm"
        ),
        "sd_log_k_speed": _half_normal(0.2, "rolling changes k by tens of per cent at most"),
        "sd_log_k_load": _half_normal(0.2, "k grows by tens of per cent over the load range of a tyre"),
        "sd_log_k_step": _half_normal(0.2, "k is a slope: the size of the step should matter little"),
        "sd_log_beta_speed": _half_normal(0.5, "a factor of up to e between speeds"),
        "sd_log_beta_load": _half_normal(0.5, "a factor of up to e between loads"),
        "sd_log_beta_step": _half_normal(
            0.5, "a factor of up to e between sizes of the step: a characteristic length should depend little on it"
        ),
        "sd_log_beta_direction_step": _half_normal(
            0.5, "as for the step, which may act in loading otherwise than in unloading"
        ),
        **{
            f"sd_log_{name}_configuration_{factor}": _half_normal(scale, reason)
            for name, scale in (("k", 0.1), ("beta", 0.25))
            for factor, reason in (
                ("speed", "half of the speed's own: tyres side by side roll much as one does"),
                ("load", "half of the load's own: tyres side by side are loaded much as one is"),
            )
        },
        "sd_log_k_case": _log_normal(0.08, 0.8, "1.6 to 38 %: what the factors leave over"),
        "sd_log_beta_case": _log_normal(0.2, 0.8, "4 to 96 %: what the factors leave over"),
        **{
            f"sd_log_{name}_{level}": _half_normal(scale, reason)
            for name, scale in (("k", 0.1), ("beta", 0.3))
            for level, reason in (
                ("specimen", "tyres of one type: k within 20 %, beta less alike; of few tyres little is known"),
                ("day", "another day, or the tyre mounted again: temperature, pressure, adjustment"),
            )
        },
        "log_k_covariate": Prior(
            dist.Normal, (0.0, 0.2), "", "k changes by up to 40 % over a standard deviation of a pressure or the like"
        ),
        "log_beta_covariate": Prior(dist.Normal, (0.0, 0.5), "", "beta by up to a factor of e"),
        "sd_log_k_repeat": _log_normal(
            0.06, 0.8, "1.2 to 29 %: a test repeated on one tyre, from a good rig to a poor one"
        ),
        "sd_log_beta_repeat": _log_normal(0.12, 0.8, "2.5 to 58 %: beta is harder to repeat than k"),
        "sd_log_k_repeat_over_speeds": _half_normal(0.7, "rolling may scatter several times as much as standing"),
        "sd_log_beta_repeat_over_speeds": _half_normal(0.7, "as for k"),
        "discordant_weight": Prior(dist.Beta, (1.0, 19.0), "", "a mean of 5 %, below 15 % with 95 % probability"),
        "student_nu": _log_normal(8.0, 0.5, "3 to 21: tails from heavy to nearly normal"),
        "J_group": Prior(
            dist.Normal, (0.0, 2.0), "kN", "friction at the start of a step, of either sign: up to a few kN"
        ),
        "sd_J": _half_normal(2.0, "what led to a step may differ from record to record", "kN"),
        "sigma_typical": _log_normal(0.03, 1.5, "0.0016 to 0.57 kN: a good cell to a coarse converter", "kN"),
        "sd_log_sigma": _half_normal(0.7, "noise differs by a factor of a few among records"),
        "noise_nu": _log_normal(
            10.0,
            0.8,
            "2.1 to 48: heavy tails to nearly normal, much as the Gamma(2, 0.1) of Juarez and Steel (2010): 2.4 to 56",
        ),
        "atanh_rho_typical": Prior(
            dist.Normal, (0.0, 0.7), "", "lag-1 autocorrelation of the noise of -0.88 to 0.88, about none"
        ),
        "sd_atanh_rho": _half_normal(0.3, "one chain of instruments: records differ little"),
        "sd_log_k_published": _log_normal(0.1, 0.8, "2 to 48 %: repeats, processing and case together"),
        "sd_log_beta_published": _log_normal(0.3, 0.8, "6 to 144 %: repeats, processing and case together"),
        "sd_log_k_published_over_speeds": _half_normal(
            0.7, "as for repeats: rolling may scatter several times as much as standing"
        ),
        "sd_log_beta_published_over_speeds": _half_normal(0.7, "as for k"),
        "settled_group": _log_normal(
            0.2, 1.0, "0.028 to 1.42 kN: x - k beta of 0.1 to 10 % of a truck tyre's load", "kN"
        ),
        "m_group": _log_normal(400.0, 0.8, "83 to 1920 kg: what hangs on a car's wheel to a heavy axle", "kg"),
        "c_group": _log_normal(0.0015, 1.2, "0.00014 to 0.0158 kN s/mm: 0.3 to 30 % of critical damping", "kN s/mm"),
        "sd_log_settled_speed": _half_normal(0.5, "as for beta: a factor of up to e between speeds"),
        "sd_log_settled_load": _half_normal(0.5, "as for beta: a factor of up to e between loads"),
        "sd_log_settled_step": _half_normal(0.5, "a friction is no length: less than beta's"),
        "sd_log_m_speed": _half_normal(0.05, "a mass stays the same; a turning tyre may seem to carry"),
        "sd_log_m_load": _half_normal(0.05, "a mass stays the same; levers may tilt under load"),
        "sd_log_m_step": _half_normal(0.05, "a mass stays the same; levers tilt more on a longer way"),
        "sd_log_c_speed": _half_normal(0.5, "turning rubber is damped otherwise: up to a factor of e"),
        "sd_log_c_load": _half_normal(0.5, "a factor of up to e between loads"),
        "sd_log_c_step": _half_normal(0.5, "up to a factor of e: rubber's damping falls with amplitude"),
        "sd_log_settled_case": _log_normal(0.2, 0.8, "4 to 96 %: what the factors leave over"),
        "sd_log_m_case": _log_normal(0.02, 0.8, "0.42 to 9.6 %: what the factors leave over"),
        "sd_log_c_case": _log_normal(0.2, 0.8, "4 to 96 %: what the factors leave over"),
        "sd_log_settled_repeat": _log_normal(0.12, 0.8, "2.5 to 58 %: as beta, with which it trades"),
        "sd_log_m_repeat": _log_normal(0.01, 0.8, "0.2 to 4.8 %: one axle, tested again"),
        "sd_log_c_repeat": _log_normal(0.12, 0.8, "2.5 to 58 %: rubber warms as it is tested"),
        "sd_log_settled_repeat_over_speeds": _half_normal(0.7, "as for k"),
        "sd_log_m_repeat_over_speeds": _half_normal(0.7, "as for k"),
        "sd_log_c_repeat_over_speeds": _half_normal(0.7, "as for k"),
        "n_group": _log_normal(1.0, 0.4, "0.46 to 2.2 about 1, where Bouc-Wen's law is Fancher's"),
        "sd_log_n_speed": _half_normal(0.2, "a shape of the loop: tens of per cent at most"),
        "sd_log_n_load": _half_normal(0.2, "a shape of the loop: tens of per cent at most"),
        "sd_log_n_step": _half_normal(0.2, "a shape of the loop: tens of per cent at most"),
        "sd_log_n_case": _log_normal(0.1, 0.8, "2 to 48 %: what the factors leave over"),
        "sd_log_n_repeat": _log_normal(0.1, 0.8, "2 to 48 %: as hard to repeat as beta"),
        "sd_log_n_repeat_over_speeds": _half_normal(0.7, "as for k"),
        "belt_frequency_group": _log_normal(
            60.0, 0.4, "27 to 131 Hz: the belt's first swing, of heavy tyres to small ones", "Hz"
        ),
        "belt_damping_group": _log_normal(0.05, 0.7, "1.3 to 20 % of critical: rubber"),
        "sidewall_ratio_group": _log_normal(
            4.0, 0.7, "1 to 16: more of the deflection is beneath the belt than beside it"
        ),
        **{
            f"sd_log_{name}_{effect}": prior
            for name in ("belt_frequency", "belt_damping", "sidewall_ratio")
            for effect, prior in {
                "speed": _half_normal(0.2, "rolling changes a belt by tens of per cent at most"),
                "load": _half_normal(0.2, "a longer contact: tens of per cent at most"),
                "step": _half_normal(0.2, "the ring is linear: the step's size matters little"),
                "case": _log_normal(0.1, 0.8, "2 to 48 %: what the factors leave over"),
                "repeat": _log_normal(0.1, 0.8, "2 to 48 %: one belt, tested again"),
                "repeat_over_speeds": _half_normal(0.7, "as for k"),
            }.items()
        },
    },
    discordant_widening=DISCORDANT_WIDENING,
    apart_widening=APART_WIDENING,
    apart_weight=APART_WEIGHT,
)
