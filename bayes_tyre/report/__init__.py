"""Figures, the HTML report and terminal tables: draws and phrases, computes nothing."""
