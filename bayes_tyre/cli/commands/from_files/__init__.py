"""Commands that read a lab's own files."""
