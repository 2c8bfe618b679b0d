"""Figures, one family a file; `catalogue` says which a result has."""
