"""Estimates of the parameters of force laws: least squares and posteriors."""
