"""Equation 2 fitted to each record by itself: bounded Levenberg-Marquardt, starting values, status, tables."""
