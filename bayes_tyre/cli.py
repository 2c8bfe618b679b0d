"""The commands of `bayes-tyre`."""
