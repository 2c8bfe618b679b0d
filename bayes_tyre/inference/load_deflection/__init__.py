"""Slow load-deflection tests: a law through a cycle, and one stiffness with the step records."""
