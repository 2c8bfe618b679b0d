"""Tables and figures of a posterior: `summary` computes, `figures` only draws."""
