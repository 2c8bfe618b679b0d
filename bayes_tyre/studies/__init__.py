"""What shows that the posterior is right: many simulated data sets, each fitted, each truth known."""
