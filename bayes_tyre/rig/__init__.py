"""The machine: lever arms, masses, geometry and calibration, no statistics."""
