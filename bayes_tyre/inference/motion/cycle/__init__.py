"""A force law's cycles at the wheel centre: the energy that they lose and their stiffness, computed from parameters."""
