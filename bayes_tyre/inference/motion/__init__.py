"""Force laws fitted to the motion of the axle."""
