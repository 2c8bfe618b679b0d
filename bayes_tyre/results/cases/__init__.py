"""Cases of a posterior: which are meant, draws of them, and those without records."""
