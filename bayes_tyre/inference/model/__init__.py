"""The hierarchical models: priors, effects, repeats, likelihood, and the coordinates in which they are sampled."""
