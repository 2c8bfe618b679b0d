"""Coordinates in which the models are sampled: estimates from the data, and reparameterisations that follow them."""
