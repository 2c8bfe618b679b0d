"""Settings of the fits of 48 simulated records in 16 cases: where these are one, so is what is compiled."""

from bayes_tyre.inference.sampling.run import SamplerSettings

#: A thousand draws tell where 2.5 % lie. The length of the warmup, the number of chains and the acceptance are part of
#: what is compiled, points of a record are not; a stated acceptance keeps a run with a divergence from being repeated.
SHORT = SamplerSettings(chains=2, warmup=350, draws=500, seed=1, target_accept=0.65)
