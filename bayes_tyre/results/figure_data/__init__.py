"""What figures show of a posterior, as values: curves with bands, densities, ranks, traces."""
