"""Least squares and posteriors of the laws' parameters."""
