"""The audit of three methods on simulated recordings of known truth: its design, its fits, what they show."""
