"""Commands on many simulated data sets: `audit`, `study`."""
