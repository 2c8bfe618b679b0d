"""The source's printed numbers, every one recomputed, and the campaign reconstructed from them."""
