"""TYDEX 1.3 (`.tdx`), a text format of tyre measurements: written with fixed widths, read with more tolerance."""
