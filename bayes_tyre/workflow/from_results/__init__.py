"""What the commands do that read the folder of a result."""
