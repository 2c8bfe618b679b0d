"""Force laws of a tyre in pure JAX: they know no file, rig or prior."""
