"""Records integrated out: summaries of them, and the model of what they share given these."""
