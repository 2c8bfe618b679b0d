"""A short run of the random command lines that `make fuzz` tries for long."""

from helpers.fuzz_commands import fuzz


def test_every_command_line_ends_as_promised(tmp_path):
    counts = fuzz(60, tmp_path, start=20190301)
    assert counts.total() == 60
    assert min(counts[2], counts[3], counts[0] + counts[4]) > 5  # usage errors, bad input and results are all reached
