"""Raw signals of known truth: plan (what is recorded), truth (its parameters), drive, motion, sensors."""
