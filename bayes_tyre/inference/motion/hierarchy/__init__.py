"""Many recordings: the hierarchical model over their estimates."""
