"""The commands, one file each: each passes its options to the workflow and prints the result."""
