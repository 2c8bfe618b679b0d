"""Nonlinear least squares of Equation 2 for each record: solvers, starting values, standard errors, status, table."""
