"""NUTS with checkpoints, and from a record table to a posterior."""
