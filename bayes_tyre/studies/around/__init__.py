"""Calibration around the records of a fit: new records of the same tests, fitted together with its own."""
