"""Recordings of a rig on disk: each format, read into raw signals."""
