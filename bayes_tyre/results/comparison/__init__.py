"""Models and force laws held against each other by what they predict: densities, ranks and weights."""
