"""The exception for faults in the user's input; the command line turns it into exit code 3."""


class BadInput(Exception):
    """Input that cannot be used; the message is one line: what is wrong, where, and what to do."""


class CutShort(BadInput):
    """The work cannot go on, what is done is kept, and the same command with --resume continues."""
