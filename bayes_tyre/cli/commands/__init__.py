"""The commands, a file each: options to the workflow's arguments, its answer to the terminal."""
