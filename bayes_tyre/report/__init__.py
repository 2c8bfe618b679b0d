"""Figures, the HTML report and terminal tables: draws and words, computes nothing."""
