"""Readers and writers of files: bytes to raw signals or tables and back, without their meaning."""
