"""Bayesian parameter identification for the stiffness and hysteresis of tyres."""
