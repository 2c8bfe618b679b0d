"""Factors between units of mechanics."""

#: One kg mm/s^2 in kN.
KN_PER_KG_MM_PER_S2 = 1e-6
