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

#: By name of the site in `hierarchical` and `motion_hierarchy`. Scales of parameters are relative (of the logarithm).
#: `settled` is x - k beta. Of the mass there is what any axle may have: the rig file's own, with which each record is
#: fitted, would count once a record.
PRIORS = Priors(
    {
        "k_group": Prior(
            dist.LogNormal, (np.log(1.0), 1.0), "kN/mm", "0.14 to 7.1 kN/mm: car tyre to a pair of truck tyres"
        ),
        "beta_group": Prior(
            dist.LogNormal,
            (np.log(0.1), 2.0),
            "mm",
            "0.002 to 5 mm: the smallest step that a laser resolves to the slip of leaf springs",
        ),
        "sd_log_k_speed": Prior(dist.HalfNormal, (0.2,), "", "rolling changes k by tens of per cent at most"),
        "sd_log_k_load": Prior(
            dist.HalfNormal, (0.2,), "", "k grows by tens of per cent over the load range of a tyre"
        ),
        "sd_log_k_step": Prior(dist.HalfNormal, (0.2,), "", "k is a slope: the size of the step should matter little"),
        "sd_log_beta_speed": Prior(dist.HalfNormal, (0.5,), "", "a factor of up to e between speeds"),
        "sd_log_beta_load": Prior(dist.HalfNormal, (0.5,), "", "a factor of up to e between loads"),
        "sd_log_beta_step": Prior(
            dist.HalfNormal,
            (0.5,),
            "",
            "a factor of up to e between sizes of the step: a characteristic length should depend little on it",
        ),
        "sd_log_beta_direction_step": Prior(
            dist.HalfNormal, (0.5,), "", "as for the step, which may act in loading otherwise than in unloading"
        ),
        **{
            f"sd_log_{name}_configuration_{factor}": Prior(dist.HalfNormal, (scale,), "", reason)
            for name, scale in (("k", 0.1), ("beta", 0.25))
            for factor, reason in (
                ("speed", "half of the speed's own: tyres side by side roll much as one does"),
                ("load", "half of the load's own: tyres side by side are loaded much as one is"),
            )
        },
        "sd_log_k_case": Prior(dist.LogNormal, (np.log(0.08), 0.8), "", "1.6 to 38 %: what the factors leave over"),
        "sd_log_beta_case": Prior(dist.LogNormal, (np.log(0.2), 0.8), "", "4 to 96 %: what the factors leave over"),
        **{
            f"sd_log_{name}_{level}": Prior(dist.HalfNormal, (scale,), "", reason)
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
        "sd_log_k_repeat": Prior(
            dist.LogNormal,
            (np.log(0.06), 0.8),
            "",
            "1.2 to 29 %: a test repeated on one tyre, from a good rig to a poor one",
        ),
        "sd_log_beta_repeat": Prior(
            dist.LogNormal, (np.log(0.12), 0.8), "", "2.5 to 58 %: beta is harder to repeat than k"
        ),
        "sd_log_k_repeat_over_speeds": Prior(
            dist.HalfNormal, (0.7,), "", "rolling may scatter several times as much as standing"
        ),
        "sd_log_beta_repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "discordant_weight": Prior(dist.Beta, (1.0, 19.0), "", "a mean of 5 %, below 15 % with 95 % probability"),
        "student_nu": Prior(dist.LogNormal, (np.log(8.0), 0.5), "", "3 to 21: tails from heavy to nearly normal"),
        "J_group": Prior(
            dist.Normal, (0.0, 2.0), "kN", "friction at the start of a step, of either sign: up to a few kN"
        ),
        "sd_J": Prior(dist.HalfNormal, (2.0,), "kN", "what led to a step may differ from record to record"),
        "sigma_typical": Prior(
            dist.LogNormal, (np.log(0.03), 1.5), "kN", "0.0016 to 0.57 kN: a good cell to a coarse converter"
        ),
        "sd_log_sigma": Prior(dist.HalfNormal, (0.7,), "", "noise differs by a factor of a few among records"),
        "noise_nu": Prior(
            dist.LogNormal,
            (np.log(10.0), 0.8),
            "",
            "2.1 to 48: heavy tails to nearly normal, much as the Gamma(2, 0.1) of Juarez and Steel (2010): 2.4 to 56",
        ),
        "atanh_rho_typical": Prior(
            dist.Normal, (0.0, 0.7), "", "lag-1 autocorrelation of the noise of -0.88 to 0.88, about none"
        ),
        "sd_atanh_rho": Prior(dist.HalfNormal, (0.3,), "", "one chain of instruments: records differ little"),
        "sd_log_k_published": Prior(
            dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: repeats, processing and case together"
        ),
        "sd_log_beta_published": Prior(
            dist.LogNormal, (np.log(0.3), 0.8), "", "6 to 144 %: repeats, processing and case together"
        ),
        "sd_log_k_published_over_speeds": Prior(
            dist.HalfNormal, (0.7,), "", "as for repeats: rolling may scatter several times as much as standing"
        ),
        "sd_log_beta_published_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "settled_group": Prior(
            dist.LogNormal,
            (np.log(0.2), 1.0),
            "kN",
            "0.028 to 1.42 kN: x - k beta of 0.1 to 10 % of a truck tyre's load",
        ),
        "m_group": Prior(
            dist.LogNormal, (np.log(400.0), 0.8), "kg", "83 to 1920 kg: what hangs on a car's wheel to a heavy axle"
        ),
        "c_group": Prior(
            dist.LogNormal,
            (np.log(0.0015), 1.2),
            "kN s/mm",
            "0.00014 to 0.0158 kN s/mm: 0.3 to 30 % of critical damping",
        ),
        "sd_log_settled_speed": Prior(dist.HalfNormal, (0.5,), "", "as for beta: a factor of up to e between speeds"),
        "sd_log_settled_load": Prior(dist.HalfNormal, (0.5,), "", "as for beta: a factor of up to e between loads"),
        "sd_log_settled_step": Prior(dist.HalfNormal, (0.5,), "", "a friction is no length: less than beta's"),
        "sd_log_m_speed": Prior(
            dist.HalfNormal, (0.05,), "", "a mass stays the same; a turning tyre may seem to carry"
        ),
        "sd_log_m_load": Prior(dist.HalfNormal, (0.05,), "", "a mass stays the same; levers may tilt under load"),
        "sd_log_m_step": Prior(dist.HalfNormal, (0.05,), "", "a mass stays the same; levers tilt more on a longer way"),
        "sd_log_c_speed": Prior(dist.HalfNormal, (0.5,), "", "turning rubber is damped otherwise: up to a factor of e"),
        "sd_log_c_load": Prior(dist.HalfNormal, (0.5,), "", "a factor of up to e between loads"),
        "sd_log_c_step": Prior(
            dist.HalfNormal, (0.5,), "", "up to a factor of e: rubber's damping falls with amplitude"
        ),
        "sd_log_settled_case": Prior(dist.LogNormal, (np.log(0.2), 0.8), "", "4 to 96 %: what the factors leave over"),
        "sd_log_m_case": Prior(dist.LogNormal, (np.log(0.02), 0.8), "", "0.42 to 9.6 %: what the factors leave over"),
        "sd_log_c_case": Prior(dist.LogNormal, (np.log(0.2), 0.8), "", "4 to 96 %: what the factors leave over"),
        "sd_log_settled_repeat": Prior(
            dist.LogNormal, (np.log(0.12), 0.8), "", "2.5 to 58 %: as beta, with which it trades"
        ),
        "sd_log_m_repeat": Prior(dist.LogNormal, (np.log(0.01), 0.8), "", "0.2 to 4.8 %: one axle, tested again"),
        "sd_log_c_repeat": Prior(dist.LogNormal, (np.log(0.12), 0.8), "", "2.5 to 58 %: rubber warms as it is tested"),
        "sd_log_settled_repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "sd_log_m_repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "sd_log_c_repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "n_group": Prior(dist.LogNormal, (0.0, 0.4), "", "0.46 to 2.2 about 1, where Bouc-Wen's law is Fancher's"),
        "sd_log_n_speed": Prior(dist.HalfNormal, (0.2,), "", "a shape of the loop: tens of per cent at most"),
        "sd_log_n_load": Prior(dist.HalfNormal, (0.2,), "", "a shape of the loop: tens of per cent at most"),
        "sd_log_n_step": Prior(dist.HalfNormal, (0.2,), "", "a shape of the loop: tens of per cent at most"),
        "sd_log_n_case": Prior(dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: what the factors leave over"),
        "sd_log_n_repeat": Prior(dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: as hard to repeat as beta"),
        "sd_log_n_repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
        "belt_frequency_group": Prior(
            dist.LogNormal,
            (np.log(60.0), 0.4),
            "Hz",
            "27 to 131 Hz: the belt's first swing, of heavy tyres to small ones",
        ),
        "belt_damping_group": Prior(dist.LogNormal, (np.log(0.05), 0.7), "", "1.3 to 20 % of critical: rubber"),
        "sidewall_ratio_group": Prior(
            dist.LogNormal, (np.log(4.0), 0.7), "", "1 to 16: more of the deflection is beneath the belt than beside it"
        ),
        **{
            f"sd_log_{name}_{effect}": prior
            for name in ("belt_frequency", "belt_damping", "sidewall_ratio")
            for effect, prior in {
                "speed": Prior(dist.HalfNormal, (0.2,), "", "rolling changes a belt by tens of per cent at most"),
                "load": Prior(dist.HalfNormal, (0.2,), "", "a longer contact: tens of per cent at most"),
                "step": Prior(dist.HalfNormal, (0.2,), "", "the ring is linear: the step's size matters little"),
                "case": Prior(dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: what the factors leave over"),
                "repeat": Prior(dist.LogNormal, (np.log(0.1), 0.8), "", "2 to 48 %: one belt, tested again"),
                "repeat_over_speeds": Prior(dist.HalfNormal, (0.7,), "", "as for k"),
            }.items()
        },
    },
    discordant_widening=DISCORDANT_WIDENING,
    apart_widening=APART_WIDENING,
    apart_weight=APART_WEIGHT,
)
