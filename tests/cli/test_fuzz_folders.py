"""A short run of the damaged results that `make fuzz` tries for long."""

from helpers.fuzz_folders import fuzz


def test_what_reads_a_damaged_result_ends_as_promised(tmp_path):
    counts = fuzz(25, tmp_path, start=20190301)
    assert counts.total() >= 25
    assert min(counts[0] + counts[4], counts[3]) > 3  # what does no harm and what is refused are both reached
