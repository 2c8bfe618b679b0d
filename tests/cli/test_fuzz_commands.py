"""A short run of the random command lines that `make fuzz` tries for long."""

from helpers.fuzz_commands import fuzz


def test_every_command_line_ends_as_promised(tmp_path):
    counts = fuzz(40, tmp_path, start=20190301)
    assert counts.total() == 40
    assert min(counts[2], counts[3], counts[0] + counts[4]) > 3  # usage errors, bad input and results are all reached
