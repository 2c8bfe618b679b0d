"""The published tables, recomputation of every printed value, and the campaign reconstructed from them."""
