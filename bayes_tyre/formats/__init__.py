"""Bytes to tables and back: nothing here knows what the numbers mean."""
