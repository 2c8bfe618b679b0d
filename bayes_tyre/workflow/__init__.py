"""What each command does, from files to files: the rooms put together, nothing computed here."""
